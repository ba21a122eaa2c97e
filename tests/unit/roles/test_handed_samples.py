"""Samples handed to displays: with them alone the image is made that the panel shows, whichever sampler chose them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_batches import TEXT, flat, plan_of, rgb_of

from wall.core.data import Event
from wall.display.sample_store import SampleStore, codes_of_halves
from wall.roles.handed_samples import why_images
from wall.roles.layer import PanelCompositor
from wall.roles.plan import first_event, on_one_machine

FRAMELESS = TEXT.replace("adaptive", "frameless")


class Display:
    """A panel, and a display that has what the panel handed on."""

    def __init__(self) -> None:
        plan = plan_of(FRAMELESS)
        self.panel, self.event = PanelCompositor(plan, 0), first_event(plan, 0.0)
        self.panel.follow(self.event)
        self.store = SampleStore(40, 24)

    def scattered(self, seed: int, *, blend: float = 1.0) -> None:
        """A third of the pixels get samples."""
        batch, rng = flat(0.5, self.event, adaptive=False, sequence=seed), np.random.default_rng(seed)
        samples = batch.samples[rng.random(len(batch.samples)) < 1 / 3].copy()
        samples["radiance"] = rng.random((len(samples), 3)) ** 2
        samples["xy"] += rng.uniform(-0.4, 0.4, samples["xy"].shape)
        self.panel.insert(replace(batch, samples=samples, base_time=float(seed), blend=blend))

    def step(self, event: Event | None = None) -> int | None:
        """Refresh the panel; the number of samples handed on, None where there are none to be handed."""
        self.panel.refresh(event or self.event, 1.0)
        assert self.panel.handed is not None
        if (samples := self.panel.handed.take()) is None:
            return None
        self.store.take(samples, rgb_of(self.panel))
        return len(samples.pixels)

    def exact(self) -> bool:
        _, samples = self.store.since(None)
        codes = codes_of_halves(float(samples.tone.gain))[samples.light]
        return np.array_equal(codes.reshape(24, 40, 3), rgb_of(self.panel))


@pytest.mark.parametrize("blend", [1.0, 0.5])
def test_the_first_are_of_every_pixel_and_then_only_what_changed(blend: float) -> None:
    shown = Display()
    shown.scattered(1, blend=blend)
    shown.panel.refresh(shown.event, 1.0)
    shown.panel.hand_samples(True)
    assert shown.step() == 40 * 24
    for seed in range(2, 12):
        shown.scattered(seed, blend=blend)
        handed = shown.step()
        assert handed is not None
        assert 0 < handed < 40 * 24 / 2
        assert shown.exact()
    assert shown.step() == 0


def test_where_samples_are_reprojected_none_are_handed_and_all_of_them_afterwards() -> None:
    shown = Display()
    shown.panel.hand_samples(True)
    shown.scattered(1)
    assert shown.step() == 40 * 24
    adaptive = replace(shown.event, camera_event=1, sampler="adaptive")
    shown.panel.follow(adaptive)
    shown.panel.insert(flat(0.3, adaptive, adaptive=True))
    assert shown.step(adaptive) is None
    shown.event = replace(shown.event, camera_event=2, sampler="frameless")
    shown.panel.follow(shown.event)
    shown.scattered(2)
    assert shown.step() == 40 * 24
    assert shown.exact()


def test_a_panel_that_nobody_asks_for_notes_nothing() -> None:
    shown = Display()
    shown.panel.hand_samples(True)
    shown.panel.hand_samples(False)
    assert (shown.panel.handed, shown.panel.newest.buffer.changed) == (None, None)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("", "renderers make them"),
        ("output: {browser: {samples: true}}\n", ""),
        ("graph: {ranks_per_panel: 2}\n", ""),
        ("graph: {preset: sort-last, ranks_per_panel: 2}\n", "operators of the graph change them"),
    ],
)
def test_why_a_panel_comes_as_images(more: str, why: str) -> None:
    (found,) = why_images(on_one_machine(plan_of(FRAMELESS + more)).layout)
    assert found.startswith(why)
    assert bool(found) == bool(why)


def test_a_panel_of_another_compositor_or_beneath_an_inset_comes_as_images() -> None:
    two = TEXT.replace("columns: 1", "columns: 2") + "graph: {compositors: 2, ranks_per_panel: 2}\n"
    inset = FRAMELESS.replace("views: [{", "views: [{id: main, ") + "output: {browser: {samples: true}}\n"
    corner = "{left: 0.1, top: 0.1, width: 0.5, height: 0.5}"
    view = "{id: map, camera: {position: [0, 24, 0.01], target: [0, 0, 0]}, viewport: " + corner + "}"
    inset = inset.replace("0.6, 0]}}]", f"0.6, 0]}}}}, {view}]")
    assert why_images(plan_of(two).layout) == ("", "another compositor makes them")
    assert why_images(plan_of(inset).layout) == ("another view lies on a panel",)
    lined = inset.replace(corner, corner.replace("0.5", "0.3", 1) + ", border: {}").replace("columns: 1", "columns: 2")
    assert "border" in lined
    assert why_images(plan_of(lined).layout) == ("another view lies on a panel", ""), "but that beside it"
