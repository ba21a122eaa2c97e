"""A panel shows the sampler that the viewer asked for, whichever packets come first or last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_batches import RECT, TEXT, flat, plan_of, refresh, rgb_of, second

from wall.core.data import Event
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.roles import early_batches
from wall.roles.early_batches import MOST_BATCHES
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan, first_event

WHITE, GREY, BLACK = 1.0, 0.5, 0.0  # radiance; GREY is 188 as a display value


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of()


def asking(method: str, number: int, plan: Plan, *, compare: str = "") -> Event:
    return replace(first_event(plan, 0.0), sampler=method, compare=compare, camera_event=number)


def shown(plan: Plan, event: Event, *, radiance: float) -> PanelCompositor:
    """A panel that shows samples of one grey of the sampler that `event` names."""
    panel = PanelCompositor(plan, 0)
    panel.follow(event)
    panel.insert(flat(radiance, event, adaptive=event.sampler == "adaptive"))
    refresh(panel, event)
    return panel


@pytest.mark.parametrize(("old", "new"), [("adaptive", "frameless"), ("frameless", "adaptive")])
def test_late_samples_of_the_sampler_before_are_left_out_and_counted(plan: Plan, old: str, new: str) -> None:
    before, after = asking(old, 1, plan), asking(new, 2, plan)
    panel = shown(plan, before, radiance=BLACK)
    panel.follow(after)
    panel.insert(flat(WHITE, after, adaptive=new == "adaptive", sequence=2))
    refresh(panel, after)
    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)

    panel.insert(flat(BLACK, before, adaptive=old == "adaptive", sequence=3))
    refresh(panel, after)

    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)
    assert panel.counters["late"] == RECT.area


@pytest.mark.parametrize(("old", "new"), [("adaptive", "frameless"), ("frameless", "adaptive")])
def test_samples_that_come_before_their_event_wait_for_it(plan: Plan, old: str, new: str) -> None:
    """A remote compositor hears of events by another way than of samples. Framed pixels of a still view come once."""
    before, after = asking(old, 1, plan), asking(new, 2, plan)
    panel = shown(plan, before, radiance=BLACK)
    panel.insert(flat(WHITE, after, adaptive=new == "adaptive", sequence=2))
    refresh(panel, before)
    assert rgb_of(panel).mean() == 0, "not asked for yet"

    panel.follow(after)
    refresh(panel, after)

    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)
    assert "late" not in panel.counters


def test_without_a_choice_the_configured_sampler_is_shown() -> None:
    for method in ("adaptive", "frameless"):
        plan = plan_of(TEXT.replace("method: adaptive", f"method: {method}"))
        panel, event = PanelCompositor(plan, 0), replace(first_event(plan, 0.0), sampler="")
        for adaptive, radiance in ((True, 0.0031308), (False, WHITE)):
            panel.insert(flat(radiance, event, adaptive=adaptive))
        panel.follow(event)
        refresh(panel, event)
        expected = 0.0031308 * 12.92 * 255 if method == "adaptive" else 255  # IEC 61966-2-1, the straight part
        assert rgb_of(panel).mean() == pytest.approx(expected, abs=1)


def test_a_second_image_has_only_samples_of_its_own_comparison(plan: Plan) -> None:
    alone, both = asking("frameless", 1, plan), asking("adaptive", 2, plan, compare="framed")
    panel = shown(plan, alone, radiance=BLACK)
    panel.insert(flat(WHITE, both, adaptive=True, sequence=2))  # before its event
    panel.insert(flat(BLACK, alone, adaptive=False, sequence=3))
    panel.follow(both)
    panel.insert(flat(GREY, both, adaptive=False, sequence=4))
    panel.insert(flat(BLACK, alone, adaptive=False, sequence=5))  # late
    refresh(panel, both)

    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)
    assert second(panel).mean() == pytest.approx(188, abs=1)
    panel.follow(asking("adaptive", 3, plan, compare="hilbert"))
    panel.insert(flat(GREY, both, adaptive=False, sequence=6))
    refresh(panel, both)
    np.testing.assert_array_equal(second(panel), rgb_of(panel), "not the comparison before")


@pytest.mark.parametrize("compare", ["framed", ""])
def test_the_half_of_a_comparison_that_comes_before_its_event_is_not_lost(plan: Plan, compare: str) -> None:
    """Of a still view it would never come again, neither when comparing begins nor when it ends."""
    both = asking("adaptive", 2 if compare else 1, plan, compare="framed")
    alone = asking("framed", 1 if compare else 2, plan)
    before, after = (alone, both) if compare else (both, alone)
    panel = PanelCompositor(plan, 0)
    panel.follow(before)
    panel.insert(flat(WHITE, after, adaptive=False, sequence=2))
    panel.follow(after)
    refresh(panel, after)
    assert (second(panel) if compare else rgb_of(panel)).mean() == pytest.approx(255, abs=1)
    assert not panel.counters.get("late", 0)


def test_old_samples_of_another_sampler_of_the_same_kind_are_late(plan: Plan) -> None:
    before, after = asking("frameless", 1, plan), asking("hilbert", 2, plan)
    panel = shown(plan, before, radiance=BLACK)
    panel.follow(after)
    panel.insert(flat(WHITE, before, adaptive=False, sequence=2))
    refresh(panel, after)
    assert rgb_of(panel).mean() == 0
    assert panel.counters["late"] == RECT.area


def test_the_image_stays_until_samples_of_the_other_sampler_come(plan: Plan) -> None:
    before, after = asking("adaptive", 1, plan), asking("frameless", 2, plan)
    panel = shown(plan, before, radiance=WHITE)
    panel.insert(flat(BLACK, before, adaptive=True, sequence=2))  # not refreshed any more
    panel.follow(after)
    refresh(panel, after)
    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)


def test_pixels_of_a_tile_keep_the_adaptive_image_until_samples_of_the_other_sampler_come(plan: Plan) -> None:
    before, after = asking("adaptive", 1, plan), asking("frameless", 2, plan)
    panel = shown(plan, before, radiance=WHITE)
    panel.follow(after)
    batch = flat(BLACK, after, adaptive=False, sequence=2)
    panel.insert(replace(batch, samples=batch.samples[:1]))

    refresh(panel, after)

    rgb = rgb_of(panel)
    assert (rgb[0, 0] == 0).all()
    assert (rgb.reshape(-1, 3)[1:] >= 254).all()


def test_adaptive_samples_are_stored_once_and_still_counted(plan: Plan) -> None:
    event = asking("adaptive", 1, plan)
    panel = shown(plan, event, radiance=WHITE)

    assert panel.samples_shown == RECT.area
    assert panel.newest_event == event.number
    assert panel.oldest_sample(1.5) == pytest.approx(1.5)
    assert panel.newest.buffer.samples_shown == 0
    assert not np.isfinite(panel.newest.buffer.records["time"]).any()


def test_back_at_the_adaptive_sampler_all_of_its_image_is_shown_at_once(plan: Plan) -> None:
    first, other, again = (asking(method, k, plan) for k, method in enumerate(("adaptive", "frameless", "adaptive")))
    panel = shown(plan, first, radiance=WHITE)
    panel.follow(other)
    panel.insert(flat(BLACK, other, adaptive=False, sequence=2))
    refresh(panel, other)
    assert rgb_of(panel).mean() == 0

    panel.follow(again)
    batch = flat(WHITE, again, adaptive=True, sequence=3)
    corner = (batch.samples["xy"] < TILE).all(1)
    panel.insert(replace(batch, samples=batch.samples[corner]))
    refresh(panel, again)
    assert np.abs(rgb_of(panel).astype(int) - 255).max() <= 1


def test_packets_that_expand_to_much_do_not_wait_for_their_event_without_end(
    plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(early_batches, "MOST_SAMPLES", 2 * RECT.area)
    future = asking("frameless", 9, plan)
    panel = shown(plan, asking("adaptive", 1, plan), radiance=WHITE)
    for k in range(5):
        panel.insert(flat(BLACK, future, adaptive=False, sequence=2 + k))
    assert panel.counters["early"] == 3 * RECT.area


def test_what_comes_long_before_its_event_is_counted_and_left_out(plan: Plan) -> None:
    now, future = asking("adaptive", 1, plan), asking("frameless", 9, plan)
    panel = shown(plan, now, radiance=WHITE)
    for k in range(MOST_BATCHES + 2):
        panel.insert(flat(BLACK, future, adaptive=False, sequence=2 + k))
    assert panel.counters["early"] == 2 * RECT.area

    panel.follow(asking("adaptive", 9, plan))
    assert panel.counters["late"] == MOST_BATCHES * RECT.area, "of another history: nobody asked"
    refresh(panel, now)
    assert rgb_of(panel).mean() == pytest.approx(255, abs=1)
