"""One object moves in a corner: what the page gets for it is its own tiles, and hardly more."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from page_viewer import with_viewer

from wall.config.loading import loads
from wall.core.data import Edits
from wall.display import parts
from wall.display.base import Status, WallImage
from wall.display.browser import Browser
from wall.display.parts import TilesPart
from wall.display.tiles import TILE
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.tracing.tracer_scene import make_tracer_scene

TEXT = """\
version: 1
scene: {source: courtyard, animation: []}
wall: {grid: {columns: 1, rows: 1, pixels: [320, 180], size: [0.32, 0.18]}}
views: [{camera: {position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}}]
sampling: {method: frameless}
"""
NAME, MOST = "jewel 6", 1.5  # a ball upon a column, before the sky
STATUS = Status(
    seconds=1.0, paused=False, sampler="frameless", samplers=("frameless",), ranks=(), latency_ms=(0.0, 0.0, 0.0),
    latencies_ms=(), refreshes_per_s=30.0, view_samplers=("frameless",),
)  # fmt: skip


def wall_image(panel):
    return WallImage(width=320, height=180, panels=(panel,), time=0.0, camera_event=0, scene_event=0)


def tiles_of(differs):
    """(rows, columns) bool: the tiles of 320 x 180 pixels in which some do."""
    return np.logical_or.reduceat(np.logical_or.reduceat(differs, range(0, 180, TILE), 0), range(0, 320, TILE), 1)


def test_what_moves_costs_at_most_half_more_bytes_than_its_own_tiles(monkeypatch: pytest.MonkeyPatch):
    """The object never stands: however slow the machine is, no image comes so late that tiles are taken to rest."""
    for rest in ("REST_S", "LONG_REST_S"):
        monkeypatch.setattr(parts, rest, float("inf"))
    plan = make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))
    single = SingleProcess(plan, make_tracer_scene(plan.scene))

    def image_of(number, name, value):
        edits = Edits(number, ((f"objects.{NAME}.{name}", value),))
        single.event = replace(single.event, scene_event=number, edits=edits)
        single.clock.advance(0.1)  # a refresh is due
        return single.until_complete()[0]

    without = image_of(1, "visible", (0.0,)).rgb
    images = [image_of(2 + k, "offset", (0.0, 0.15 + 0.03 * k, 0.0)) for k in range(8)]
    covered = [tiles_of((image.rgb != without).any(-1)) for image in images]

    async def act(viewer):
        sent = own = 0
        for k, image in enumerate(images):
            before = browser.sent_bytes
            browser.show(wall_image(image), STATUS)
            number, panels = await viewer.next_image()
            assert panels[0][0] == image.version
            await viewer.drawn(number)
            if k > 0:
                sent += browser.sent_bytes - before
                part = TilesPart(image, covered[k] | covered[k - 1], exactly=False, change=1)
                own += sum(len(piece.encoded) for piece in part.encode()[1])
        return sent, own

    with closing(Browser("127.0.0.1", 0, plan.layout.wall)) as browser:
        sent, own = with_viewer(browser, act)
    assert all(0 < each.sum() < 12 for each in covered)
    assert 0 < sent <= MOST * own, (sent, own)
