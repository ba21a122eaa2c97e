"""Progressive sampling: coarse passes that hold their rate, stages that double, means without bias."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.core.data import MOST_SAMPLES, SAMPLE, Edits, Event, Float32, Rect, Samples
from wall.sampling.base import Targets
from wall.sampling.pixel_means import PixelMeans
from wall.sampling.progressive import ProgressiveSampler, Schedule, tiles_of

RECT = Rect(x=5, y=3, width=37, height=26)
Path = Callable[[int], Event]


class Run:
    """A sampler with a clock of its own, and what it has shown so far."""

    def __init__(self, *, sample_s: float = 1e-6, batch: int = 64, rect: Rect = RECT, **schedule: float) -> None:
        self.now, self.sample_s = 0.0, sample_s
        self.sampler = ProgressiveSampler(
            rect, lambda: self.now, Schedule(**schedule), batch=batch, seed=7  # type: ignore[arg-type]
        )  # fmt: skip
        self.rect, self.shown = rect, np.full((rect.height, rect.width), np.nan)
        self.updates: list[NDArray[np.intp]] = []

    def step(self, event: Event) -> Targets | None:
        """One batch; a sample's radiance is its x within its pixel. Half of its time goes by while it is shown."""
        targets = self.sampler.choose(event)
        if targets is None:
            return None
        began = self.now
        self.now += 0.5 * self.sample_s * len(targets.xy)
        samples = np.zeros(len(targets.xy), SAMPLE)
        samples["xy"], samples["radiance"] = targets.xy, (targets.xy[:, :1] % 1.0)
        self.sampler.observe(samples, began)
        self.show(self.sampler.resolve())
        self.now += 0.5 * self.sample_s * len(targets.xy)
        return targets

    def show(self, records: Samples) -> None:
        assert (records["xy"] % 1 == 0.5).all()
        x, y = (records["xy"] - (self.rect.x, self.rect.y)).astype(int).T
        self.shown[y, x] = records["radiance"][:, 0]
        if len(records):
            self.updates.append(np.unique(np.stack([y, x], 1), axis=0))

    def until_rest(self, event: Event) -> list[Targets]:
        found = []
        while (targets := self.step(event)) is not None:
            found.append(targets)
        return found


@pytest.mark.parametrize("rect", [RECT, Rect(x=0, y=0, width=3, height=50), Rect(x=9, y=9, width=5000, height=20)])
def test_tiles_cover_a_region_once(rect: Rect) -> None:
    counts = np.zeros((rect.y + rect.height, rect.x + rect.width), int)
    for tile in tiles_of(rect):
        counts[tile.y : tile.y + tile.height, tile.x : tile.x + tile.width] += 1
        assert tile.area <= 65536
    assert (counts[rect.y :, rect.x :] == 1).all()
    assert counts.sum() == rect.area


def test_stages_double_with_a_rest_between_and_end(camera_path: Path) -> None:
    run = Run(first_stage=2, samples_per_pixel=14, rest_s=0.5, first_depth=3, depth=3)
    first = run.until_rest(camera_path(0))
    assert sum(len(t.xy) for t in first) == (1 + 2) * RECT.area  # one a pixel at once, then the first stage
    assert run.sampler.samples == 2
    assert run.step(camera_path(0)) is None
    for wanted in (4, 8):
        run.now += 0.51
        assert sum(len(t.xy) for t in run.until_rest(camera_path(0))) == wanted * RECT.area
    assert run.sampler.samples == 14
    run.now += 10.0
    assert run.step(camera_path(0)) is None


def test_an_edited_end_begins_nothing_anew(camera_path: Path) -> None:
    """Of the same image: more samples are added to those that are there, and fewer end it after its stage."""
    run, event = Run(first_stage=2, samples_per_pixel=6, rest_s=0.0, first_depth=3, depth=3), camera_path(0)
    run.until_rest(event)
    assert run.sampler.samples == 6
    more = replace(event, edits=Edits(1, ((MOST_SAMPLES, (20.0,)),)))
    added = run.until_rest(more)
    assert sum(len(t.xy) for t in added) == (20 - 6) * RECT.area
    assert {t.event.edits.number for t in added} == {1}
    assert run.until_rest(replace(event, edits=Edits(2, ((MOST_SAMPLES, (3.0,)),)))) == []
    assert run.sampler.samples_shown == 20


def test_each_pixel_shows_the_mean_of_its_samples(camera_path: Path) -> None:
    """With paths of one length every stage counts: 2 + 4 + 8 samples, each at its own place of the sequence."""
    run = Run(first_stage=2, samples_per_pixel=14, rest_s=0.0, first_depth=3, depth=3)
    run.until_rest(camera_path(0))
    wanted = PixelMeans(RECT, seed=7)
    for k in range(14):
        xy = wanted.positions(k)
        samples = np.zeros(len(xy), SAMPLE)
        samples["xy"], samples["radiance"] = xy, xy[:, :1] % 1.0
        wanted.add(samples)
    np.testing.assert_allclose(run.shown, wanted.mean()[:, :, 0], rtol=1e-6)


def test_paths_get_longer_by_a_surface_a_stage_and_no_mean_is_of_two_lengths(
    compiled_only: None, camera_path: Path
) -> None:
    run = Run(first_stage=2, samples_per_pixel=64, rest_s=0.0, first_depth=2, depth=4)
    depths: dict[int | None, int] = {}
    for targets in run.until_rest(camera_path(0)):
        depths[targets.depth] = depths.get(targets.depth, 0) + len(targets.xy)
    assert {depth: count // RECT.area for depth, count in depths.items()} == {2: 1 + 2, 3: 4, 4: 64}
    assert [t.number for t in run.until_rest(camera_path(1))][-1] == 63


def test_a_stage_is_shown_tile_by_tile(camera_path: Path) -> None:
    run = Run(first_stage=2, samples_per_pixel=2)
    run.until_rest(camera_path(0))
    assert len(run.updates) == 2 * len(tiles_of(RECT))
    for update, tile in zip(run.updates, tiles_of(RECT), strict=False):
        assert len(update) == tile.area


def test_an_input_breaks_a_stage_off_after_one_batch(camera_path: Path) -> None:
    run = Run(first_stage=64, samples_per_pixel=64)
    while not run.updates or run.sampler._moving:
        run.step(camera_path(0))
    for _ in range(5):
        run.step(camera_path(0))
    targets = run.step(camera_path(1))
    assert targets is not None
    assert targets.event.camera_event == 1


def test_while_the_input_changes_every_pass_ends_in_time(camera_path: Path) -> None:
    """A sample takes so long that only every tenth pixel can be traced; yet every pixel shows something."""
    run = Run(sample_s=1e-3, target_hz=10.0, batch=16)
    run.until_rest(camera_path(0))
    assert run.sampler._step == 1
    for k in range(1, 6):
        began, updates = run.now, len(run.updates)
        run.shown[:] = np.nan
        while len(run.updates) - updates < len(tiles_of(RECT)):
            run.step(camera_path(k))
        assert np.isfinite(run.shown).all()
        assert run.now - began <= 0.1
    assert run.sampler._step == 8


def test_a_fast_machine_answers_with_several_samples_a_pixel(camera_path: Path) -> None:
    run = Run(sample_s=1e-6, target_hz=100.0, first_stage=8, batch=200)
    run.until_rest(camera_path(0))
    numbers = []
    for _ in range(3 * RECT.area // 200):
        targets = run.step(camera_path(1))
        assert targets is not None
        numbers.append(targets.number)
    assert max(number or 0 for number in numbers) == 7  # 8 samples, though 10 would fit


def test_what_was_lost_is_shown_again(camera_path: Path) -> None:
    run = Run(first_stage=1, samples_per_pixel=1)
    run.until_rest(camera_path(0))
    lost: Float32 = np.array([[5.5, 3.5], [6.5, 3.5]], np.float32)
    records = np.zeros(2, SAMPLE)
    records["xy"], records["radiance"] = lost, 0.75
    run.sampler.forget(records, 0.0)
    targets = run.step(camera_path(0))
    assert targets is not None
    assert len(targets.xy) == 0
    assert run.shown[0, 0] == run.shown[0, 1] == 0.75
    assert run.step(camera_path(0)) is None


def test_a_restart_answers_the_same_event_again(camera_path: Path) -> None:
    run = Run(first_stage=1, samples_per_pixel=1)
    run.until_rest(camera_path(0))
    run.sampler.restart()
    assert sum(len(t.xy) for t in run.until_rest(camera_path(0))) == 2 * RECT.area


@pytest.mark.parametrize(("depth", "samples"), [(3, 24), (9, 16)])
def test_the_estimated_error_is_about_the_true_one(
    compiled_only: None, camera_path: Path, depth: int, samples: int
) -> None:
    """Noise of 0.1 about 0.5: of all stages together, and of the last stage alone where paths get longer."""
    rect = Rect(x=0, y=0, width=64, height=48)
    run = Run(
        rect=rect, first_stage=8, samples_per_pixel=24 if depth == 3 else 16, first_depth=3, depth=depth, rest_s=0
    )
    noise = np.random.default_rng(5)
    while (targets := run.sampler.choose(camera_path(0))) is not None:
        found = np.zeros(len(targets.xy), SAMPLE)
        found["xy"], found["radiance"] = targets.xy, 0.5 + 0.1 * noise.standard_normal((len(found), 3))
        run.sampler.observe(found, run.now)
        run.show(run.sampler.resolve())
        run.now += 0.01
    assert run.sampler.samples_shown == samples
    slope = 255.0 * 1.055 / 2.4 * 0.5 ** (1 / 2.4 - 1.0)  # of sRGB codes at 0.5
    assert run.sampler.square_error**0.5 == pytest.approx(0.1 * slope / samples**0.5, rel=0.05)
    run.sampler.choose(camera_path(1))
    assert (run.sampler.samples_shown, run.sampler.square_error) == (0, 0.0)


def test_a_coarse_pass_begins_with_the_tiles_that_an_edit_has_changed(
    compiled_only: None, camera_path: Path
) -> None:
    """Each of 32 x 32 pixels has 16 probes, of noise that is as large as the change; all else is as it was."""
    rect, noise = Rect(x=0, y=0, width=256, height=256), np.random.default_rng(3)
    run = Run(rect=rect, batch=1024, first_stage=1, samples_per_pixel=1)
    changed = [tile for tile in tiles_of(rect) if (tile.x, tile.y) in ((64, 32), (160, 160), (0, 224))]

    def step(event: Event, light: float) -> Targets | None:
        targets = run.sampler.choose(event)
        if targets is None:
            return None
        samples = np.zeros(len(targets.xy), SAMPLE)
        samples["xy"], samples["radiance"] = targets.xy, 0.2 * noise.uniform(0.8, 1.2, (len(targets.xy), 1))
        for tile in changed:
            x, y = np.floor(targets.xy).T - ((tile.x,), (tile.y,))
            samples["radiance"][(x >= 0) & (x < tile.width) & (y >= 0) & (y < tile.height)] *= light
        run.sampler.observe(samples, run.now)
        run.now += 1e-6 * len(samples)
        run.show(run.sampler.resolve())
        return targets

    while step(camera_path(0), 1.0) is not None:
        pass
    run.updates.clear()
    while len(run.updates) < 3:
        targets = step(camera_path(1), 0.7)
        assert targets is not None
        assert len(targets.xy) <= 1024
    found = {tuple(update.min(axis=0)[::-1].tolist()) for update in run.updates}
    assert found == {(tile.x, tile.y) for tile in changed}
