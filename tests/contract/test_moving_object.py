"""One object moves in a corner: what the page gets for it is its own tiles, and hardly more."""

from __future__ import annotations

import itertools
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from page_viewer import with_viewer

from wall.config.loading import loads
from wall.core.data import Edits
from wall.display import parts
from wall.display.base import PanelImage, Status, WallImage
from wall.display.browser import Browser
from wall.display.parts import TilesPart
from wall.display.tiles import TILE, updated
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.study.quality.method import Inputs, centres
from wall.study.quality.methods_adaptive import AdaptiveMethod
from wall.study.quality.metrics import display_values
from wall.study.quality.trial import Trial, setup_of
from wall.tracing.tracer import Tracer
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
    height, width = panel.rgb.shape[:2]
    return WallImage(width=width, height=height, panels=(panel,), time=0.0, camera_event=0, scene_event=0)


def tiles_of(differs):
    """(rows, columns) bool: the tiles of an image's pixels in which some do."""
    height, width = differs.shape
    return np.logical_or.reduceat(np.logical_or.reduceat(differs, range(0, height, TILE), 0), range(0, width, TILE), 1)


def bytes_of(browser, images, own_tiles):
    """What a viewer does: returns the bytes that images after the first are sent as, and those of their own tiles."""

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
                part = TilesPart(image, own_tiles[k - 1], exactly=False, change=1)
                own += sum(len(piece.encoded) for piece in part.encode()[1])
        return sent, own

    return act


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

    with closing(Browser("127.0.0.1", 0, plan.layout.wall)) as browser:
        sent, own = with_viewer(browser, bytes_of(browser, images, [a | b for a, b in itertools.pairwise(covered)]))
    assert all(0 < each.sum() < 12 for each in covered)
    assert 0 < sent <= MOST * own, (sent, own)


FIRST, LAST = 220, 240  # refreshes: seven seconds, after which all that stands is nearly complete


def test_beside_what_moves_the_adaptive_sampler_sends_hardly_anything(monkeypatch: pytest.MonkeyPatch, compiled_only):
    """At 400,000 rays/s; no mirrors, any of which may show the ring that turns."""
    for rest in ("REST_S", "LONG_REST_S"):
        monkeypatch.setattr(parts, rest, float("inf"))
    config = Path(__file__).parents[2] / "configs/measure/one_mover.yaml"
    trial = Trial(config=config, method="adaptive", rate=400e3, size=(240, 136), seed=1, refresh_hz=30.0)
    setup = replace(setup_of(trial), input_step_s=1 / 60)
    method, inputs = AdaptiveMethod(setup, sends=False), Inputs(setup.plan)
    tracer = Tracer(setup.tracer_scene, setup.panel, setup.plan.view.eye, coherent=False)
    aside = np.array([[-0.3, -0.2], [0.2, -0.3], [0.3, 0.2], [-0.2, 0.3]], np.float32)

    def exact(k):
        """(h, w, 3) of 0 to 255, of four samples a pixel."""
        tracer.set_event(inputs.event_at(k / 30))
        image = np.zeros((136, 240, 3))
        for shift in aside:
            samples, _ = tracer.trace(centres(setup) + shift)
            x, y = samples["xy"].astype(int).T
            image[y, x] += 0.25 * samples["radiance"]
        return 255.0 * display_values(image.astype(np.float32))

    images, own, ideal = [], [], exact(FIRST)
    for k in range(1, LAST):
        method.advance(k / 30)
        rgb = np.rint(255.0 * display_values(method.show(k / 30))).astype(np.uint8)
        if k == FIRST:
            images.append(PanelImage(id="r0c0", rgb=rgb, screen=(0, 0), version=k))
        elif k > FIRST:
            images.append(updated(images[-1], rgb, k))
            before, ideal = ideal, exact(k)
            own.append(tiles_of((np.abs(ideal - before) > 2.0).any(-1)))
    with closing(Browser("127.0.0.1", 0, setup.plan.layout.wall)) as browser:
        sent, wanted = with_viewer(browser, bytes_of(browser, images, own))
    assert all(each.any() for each in own)
    assert np.mean([each.mean() for each in own]) < 0.3, "a corner"
    print(sent/wanted, np.mean([each.mean() for each in own]))
    assert 0 < sent <= MOST * wanted, (sent, wanted)
