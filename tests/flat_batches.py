"""Batches of one grey for a small panel, and the image they make: what shows whose samples are on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import SAMPLE, Batch, Event, Rect
from wall.packets.samples import decode, encode
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, make_layout, make_plan
from wall.roles.present import display_bytes

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 24], size: [0.4, 0.24]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: adaptive, samples_per_batch: 128}
"""
RECT = Rect(x=0, y=0, width=40, height=24)


def plan_of(text: str = TEXT) -> Plan:
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


def flat(value: float, event: Event, *, adaptive: bool, sequence: int = 1) -> Batch:
    """One sample a pixel of one grey."""
    samples = np.zeros(RECT.area, SAMPLE)
    x, y = np.meshgrid(np.arange(RECT.width) + 0.5, np.arange(RECT.height) + 0.5)
    samples["xy"] = np.stack([x.ravel(), y.ravel()], 1)
    samples["radiance"], samples["depth"] = value, np.inf
    return decode(
        encode(
            Batch(
                view=0, panel=0, rect=RECT, rank=1, sequence=sequence, camera_event=event.camera_event,
                scene_event=event.scene_event, base_time=0.0, samples=samples, camera=event.camera, adaptive=adaptive,
            )
        )
    )  # fmt: skip


def rgb_of(panel: PanelCompositor) -> NDArray[np.uint8]:
    """(h, w, 3) uint8, what a layer shows."""
    return display_bytes(panel.framelet, panel.framelet.rect)


def second(panel: PanelCompositor) -> NDArray[np.uint8]:
    """(h, w, 3) uint8, what its second sampler shows."""
    assert panel.compared is not None
    return display_bytes(panel.compared.framelet, panel.framelet.rect)


def refresh(panel: PanelCompositor, event: Event) -> None:
    panel.refresh(event, 1.0)
    if panel.compared is not None:
        panel.compared.refresh(1.0)
