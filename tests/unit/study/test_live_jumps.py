"""`wall measure live` where the camera jumps: moments follow the jumps evenly, and errors are told by time since."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import load, loads
from wall.config.views import CameraKeyframeConfig, KeyframesPathConfig, OrbitPathConfig
from wall.core.errors import RunError
from wall.display.image_log import LoggedImages, LoggedPanel
from wall.roles.plan import make_layout
from wall.study.live.command import methods_of, tables_after_jumps
from wall.study.live.jumps import jumps_of, moments_after, since_jump
from wall.study.live.rewriting import load_without_windows, text_for
from wall.study.live.rows import Row
from wall.study.live.scores import Shown, enlarged

CUTS = Path("configs/measure/cuts.yaml")
ROW = Row(
    config="a", method="adaptive", cores=2.0, rmse_display=0.1, flip=0.2, ssim=0.9, refresh_hz=30.0,
    interval_p95_ms=34.0, latency_p50_ms=20.0, latency_p95_ms=30.0, latency_p99_ms=40.0, samples_per_s=4e5,
    bytes_per_s=2e6, cpu_s={}, run_s=5.0, seconds=3.0, warm_up_s=2.0, panels=1, pixels=192, display_delay_s=0.03,
    error_over_time=[0.1], times=[2.5], log_cpu_s=0.01, dropped={}, setup="s", reference="r", spp=64, other_cores=0.0,
    commit="c", machine="m", command="wall",
)  # fmt: skip
A, B = (0.0, 0.0, 1.0), (0.0, 3.0, 1.0)


def path_of(*frames: tuple[float, tuple[float, float, float]], loop: bool) -> KeyframesPathConfig:
    keyframes = tuple(CameraKeyframeConfig(time=time, position=at, target=(0.0, 0.0, 0.0)) for time, at in frames)
    return KeyframesPathConfig(type="keyframes", loop=loop, keyframes=keyframes)


def test_a_camera_jumps_where_keyframes_next_to_each_other_are_elsewhere():
    path = path_of((0.0, A), (0.999, A), (1.0, B), (1.001, B), (3.0, A), loop=True)

    assert jumps_of(path, 0.0, 8.0) == pytest.approx([1.0, 4.0, 7.0])
    assert jumps_of(path, 1.5, 4.0) == pytest.approx([4.0])
    assert jumps_of(path.model_copy(update={"loop": False}), 0.0, 8.0) == [1.0]
    assert jumps_of(path_of((0.0, A), (2.0, B), loop=True), 0.0, 5.0) == [0.0, 2.0, 4.0], "where the loop ends"
    assert jumps_of(OrbitPathConfig(type="orbit", period_s=2.0), 0.0, 8.0) == []
    assert jumps_of(None, 0.0, 8.0) == []


def test_the_measuring_scene_jumps_three_times_in_three_seconds():
    path = load(CUTS).config.views[0].path

    assert jumps_of(path, 2.0, 6.0) == pytest.approx([2.25, 3.75, 4.5, 5.25, 6.75, 7.5])


def test_every_time_since_a_jump_is_looked_at_equally_often_whatever_the_intervals():
    jumps = [2.25, 3.75, 4.5, 5.25, 6.75, 7.5]

    times = moments_after(jumps, 24, end=8.0)

    since = since_jump(times, jumps)
    assert sorted(since) == pytest.approx([0.75 * (k + 0.5) / 24 for k in range(24)])
    assert times == sorted(times)
    assert max(times) < 7.5, "less than 0.75 s follow the last jump"
    assert {round(time - after, 9) for time, after in zip(times, since, strict=True)} == set(jumps[:-1])
    assert moments_after([1.0], 2, end=3.0) == pytest.approx([1.5, 2.5])


def test_framed_rendering_of_fewer_pixels_keeps_the_aspect_and_is_enlarged_where_it_is_scored():
    assert methods_of("reduced_64,framed") == ("reduced_64", "framed")
    found = loads(text_for(load_without_windows(CUTS), "reduced_64"))

    assert found.config.sampling_of(0).method == "framed"
    assert {each.pixels for each in make_layout(found).wall.panels} == {(120, 68)}
    image = LoggedPanel(
        time=0.0, refresh=0.0, panel="a", version=0, screen=(0, 0), size=(4, 2), offset=0, camera_event=0,
        scene_event=0, scene_time=0.0,
    )  # fmt: skip
    shown = LoggedImages(began=0.0, display_delay_s=0.0, panels=(image,), cpu_s=0.0, pixels=np.zeros(24, np.uint8))
    large = make_layout(load_without_windows(CUTS)).wall.panels[0]
    large = replace(large, id="a", pixels=(8, 4))
    assert Shown(shown, enlarges=True).codes(large, 1.0).shape == (4, 8, 3)
    with pytest.raises(RunError, match="an image of"):
        Shown(shown).codes(large, 1.0)


def test_enlarged_images_lie_where_the_small_ones_did():
    ramp = np.repeat(np.arange(0, 200, 10, dtype=np.uint8)[None, :, None], 3, axis=2).repeat(6, axis=0)

    found = enlarged(ramp, (80, 24))

    assert found.shape == (24, 80, 3)
    wanted = (np.arange(80) + 0.5) / 4 * 10 - 5.0  # the ends are held
    assert np.abs(found[7, 6:-6, 0] - wanted[6:-6]).max() <= 0.5 + 1e-6


def test_errors_are_told_by_the_time_since_a_jump():
    row = replace(
        ROW, since_jump=[0.01, 0.04, 0.12, 0.6], error_over_time=[0.3, 0.4, 0.1, 0.02],
        flip_over_time=[0.5, 0.7, 0.2, 0.1],
    )  # fmt: skip

    [table] = tables_after_jumps([row, replace(ROW, config="b")])

    assert table.columns == ("method", "to 0.05 s", "to 0.15 s", "to 0.75 s")
    rms = 255.0 * ((0.3**2 + 0.4**2) / 2) ** 0.5
    assert table.lines == (("adaptive", f"{rms:.1f} (0.600)", "25.5 (0.200)", "5.1 (0.100)"),)
