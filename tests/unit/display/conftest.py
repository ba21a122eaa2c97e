"""Small walls, images and a status, made by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from wall.config.screens import GridConfig, WallConfig
from wall.display.base import PanelImage, RankStatus, RankTotals, Status, WallImage
from wall.geometry.expanding import expand
from wall.geometry.panels import Wall

ImageMaker = Callable[..., WallImage]


@pytest.fixture
def two_panels() -> Wall:
    """Two panels of 16 x 8 pixels side by side with bezels, one centimetre a pixel."""
    grid = GridConfig(columns=2, rows=1, pixels=(16, 8), size=(0.16, 0.08), bezel={"left": 0.01, "right": 0.01})
    return expand(WallConfig(grid=grid))


@pytest.fixture
def image(two_panels: Wall) -> ImageMaker:
    """image(version, time=..., value=...): both panels filled with `value` plus their index."""

    def make(version: int = 1, *, time: float = 0.0, value: int = 100, events: tuple[int, int] = (0, 0)) -> WallImage:
        panels = tuple(
            PanelImage(
                id=p.id,
                rgb=np.full((p.pixels[1], p.pixels[0], 3), value + p.index, np.uint8),
                screen=p.screen,
                version=version,
            )
            for p in two_panels.panels
        )
        return WallImage(
            width=two_panels.width,
            height=two_panels.height,
            panels=panels,
            time=time,
            camera_event=events[0],
            scene_event=events[1],
        )

    return make


@pytest.fixture
def status() -> Status:
    ranks = tuple(
        RankStatus(
            rank=k,
            role="renderer",
            panel=f"r0c{k}",
            region="",
            samples_per_s=1e6,
            bytes_per_s=8e6,
            oldest_sample_s=float("inf") if k else 0.25,
            dropped=k,
            alive=True,
            memory_mb=150.0,
        )
        for k in range(2)
    )
    return Status(
        seconds=1.5,
        paused=False,
        sampler="hilbert",
        samplers=("framed", "hilbert"),
        ranks=ranks,
        latency_ms=(20.0, 30.0, 40.0),
        latencies_ms=(20.0, 30.0),
        refreshes_per_s=30.0,
        totals=(RankTotals(host=""),) * 2,
    )
