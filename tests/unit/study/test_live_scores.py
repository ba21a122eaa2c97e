"""`wall measure live`: which image was on the wall at a moment, how often it changed, and how far it was from right."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from wall.display.image_log import LoggedImages, LoggedPanel
from wall.study.live import scores
from wall.study.live.scores import Shown, score
from wall.study.live.timeline import Timeline, intervals, moments

BEGAN, DELAY_S = 100.0, 0.03


def panel(name: str, version: int, *, time: float, refresh: float, size: tuple[int, int] = (2, 1)) -> LoggedPanel:
    return LoggedPanel(
        time=BEGAN + time, refresh=BEGAN + refresh, panel=name, version=version, screen=(0, 0), size=size,
        offset=3 * size[0] * size[1] * version, camera_event=0, scene_event=0, scene_time=0.0,
    )  # fmt: skip


def log(*panels: LoggedPanel) -> LoggedImages:
    pixels = np.arange(1000, dtype=np.uint16).astype(np.uint8)
    return LoggedImages(began=BEGAN, display_delay_s=DELAY_S, panels=panels, cpu_s=0.0, pixels=pixels)


def test_held_picture_is_the_newest_that_was_light():
    timeline = Timeline(
        log(
            panel("a", 0, time=0.01, refresh=0.0),  # light at 0.03: the display's delay after its refresh
            panel("b", 0, time=0.01, refresh=0.0),
            panel("a", 1, time=1.25, refresh=1.0),  # light at 1.25: it took longer than that
        )
    )

    assert timeline.held("a", 0.029) is None
    assert [timeline.held("a", t).version for t in (0.031, 1.249, 1.2501, 9.0)] == [0, 0, 1, 1]
    assert timeline.held("b", 9.0).version == 0, "a panel that did not change is held"
    assert timeline.held("c", 9.0) is None


def test_what_a_neighbour_changes_in_an_overlap_is_no_image_of_the_panel_s_own():
    """Panels of 8x1 pixels that share 2, each at 10 Hz, in turn: each image also changes the other's overlap."""
    shown, pixels = [], []
    for k in range(40):
        tick = np.array([k // 2, (k + 1) // 2]) % 250  # of a and b
        for name, x, own in (("a", 0, tick[0]), ("b", 6, tick[1])):
            row = np.full(8, own)
            row[6:8] = k  # the newest of both
            row = row if name == "a" else row[::-1]
            at, time = 24 * len(shown), 0.05 * k
            pixels.append(np.repeat(row, 3))
            shown.append(replace(panel(name, k, time=time, refresh=time, size=(8, 1)), screen=(x, 0), offset=at))
    both = replace(log(*shown), pixels=np.concatenate(pixels).astype(np.uint8))

    assert Timeline(both, 0.0).intervals(0.2, 1.6).refresh_hz == pytest.approx(10.0, abs=0.7)


def test_intervals_are_of_the_pictures_within_the_span():
    times = [0.5, *np.arange(1.0, 2.0, 0.1), 2.4, 5.0]

    found = intervals([times], 0.9, 1.6)  # 1.0, 1.1 ... 1.9, 2.4

    assert found.refresh_hz == pytest.approx(11 / 1.6)
    steps = [0.5, *[0.1] * 9, 0.5]
    assert found.p95_ms == pytest.approx(1000 * np.percentile(steps, 95))


def test_refreshes_are_those_of_a_panel_whether_panels_change_together_or_in_turn():
    ticks = np.arange(0.0, 10.0, 0.1)

    together = intervals([list(ticks), list(ticks)], 1.0, 4.0)
    in_turn = intervals([list(ticks), list(ticks + 0.05)], 1.0, 4.0)

    assert together.refresh_hz == pytest.approx(10.0, abs=0.3)
    assert in_turn.refresh_hz == pytest.approx(together.refresh_hz, abs=0.3)
    assert in_turn.p95_ms == pytest.approx(100.0)


def test_display_delay_of_the_log_can_be_replaced():
    found = log(panel("a", 0, time=0.01, refresh=0.0))

    assert Timeline(found, 0.0).held("a", 0.011) is not None
    assert Timeline(found, 0.5).held("a", 0.499) is None


@pytest.mark.parametrize("times", [[], [0.5]])
def test_a_panel_that_never_changes_has_one_interval_as_long_as_the_span(times):
    found = intervals([times], 1.0, 3.0)

    assert (found.refresh_hz, found.p95_ms) == (0.0, 3000.0)


def test_moments_are_spread_and_always_the_same():
    found = moments(24, first=2.0, seconds=6.0)

    assert found == moments(24, first=2.0, seconds=6.0)
    assert [math.floor((t - 2.0) / 0.25) for t in found] == list(range(24))
    assert np.ptp(np.diff(found)) > 0.1, "not in step with a display"


def test_shown_codes_are_those_of_the_log_and_black_before():
    shown = Shown(log(panel("a", 0, time=0.01, refresh=0.0), panel("a", 1, time=1.25, refresh=1.0)))
    a = Panelled("a")

    assert shown.codes(a, 0.0).tolist() == [[[0, 0, 0], [0, 0, 0]]]
    assert shown.codes(a, 1.0).tolist() == [[[0, 1, 2], [3, 4, 5]]]
    assert shown.codes(a, 2.0).tolist() == [[[6, 7, 8], [9, 10, 11]]]


class Panelled:
    """As much of a panel as is looked at."""

    def __init__(self, name: str, pixels: tuple[int, int] = (2, 1)) -> None:
        self.id, self.pixels = name, pixels


class Flat:
    """Reference images of one grey on two panels, one of which has three times the pixels."""

    def __init__(self, code: int) -> None:
        self.wall, self.times, self._code = self, [0.5, 1.5], code
        self.panels = [Panelled("a", (8, 8)), Panelled("b", (24, 8))]

    def display(self, name: str, k: int) -> np.ndarray:
        width, height = next(p.pixels for p in self.panels if p.id == name)
        return np.full((height, width, 3), self._code / 255.0, np.float32)


def test_score_counts_pixels_and_moments_alike(monkeypatch):
    monkeypatch.setattr(scores, "flip", lambda a, b: float(np.abs(a - b).max()))  # OpenMP's threads survive no fork
    monkeypatch.setattr(scores, "ssim", lambda a, b: 1.0 - float(np.abs(a - b).max()))
    reference = Flat(20)  # nothing is light at 0.5; then panel a has the reference image and b is still black
    pixels = np.full(3 * 64, 20, np.uint8)
    found = replace(log(panel("a", 0, time=1.0, refresh=1.0, size=(8, 8))), pixels=pixels)

    result = score(Shown(found), reference)

    black = 20 / 255
    assert result.over_time == pytest.approx([black, math.sqrt(0.75) * black])
    assert result.rmse_display == pytest.approx(math.sqrt((1 + 0.75) / 2) * black)
    assert result.flip == pytest.approx((1 + 0.75) / 2 * black)
    assert result.ssim == pytest.approx(1 - (1 + 0.75) / 2 * black)
