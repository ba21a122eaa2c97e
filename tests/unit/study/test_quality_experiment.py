"""The experiment itself: reference images, clocks, plain methods, trials, and the command around them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from wall import cli
from wall.commands.render import render
from wall.config.loading import loads
from wall.core.data import Float32
from wall.core.errors import ConfigError, RunError
from wall.geometry.expanding import expand
from wall.roles.plan import make_layout, make_plan
from wall.study.quality import command
from wall.study.quality.clocks import CpuClock
from wall.study.quality.method import Setup
from wall.study.quality.methods import METHODS, make_method
from wall.study.quality.reference import SEED, Reference, cache_folder, reference_refreshes
from wall.study.quality.sweep import Wanted
from wall.study.quality.trial import Trial, on_one_panel, setup_of

SIZE = (32, 24)
MOVING = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 2, rows: 1, pixels: [64, 64], size: [0.3, 0.3]}}
views: [{camera: {position: [6, 4, 8], target: [0, 1, 0], fov: 40}, path: {type: orbit, period_s: 4}}]
"""
HALF_WAY = 2.0**-11  # of a float16, relative


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    images = tmp_path / "cache"  # a folder of their own; $XDG_CACHE_HOME would be that of compiled kernels too
    monkeypatch.setattr("wall.study.quality.reference.cache_folder", lambda: images)
    path = tmp_path / "moving.yaml"
    path.write_text(MOVING)
    return path


def trial_of(config: Path, method: str = "framed", rate: float = 1e4) -> Trial:
    return Trial(config=config, method=method, rate=rate, size=SIZE, seed=1)


@pytest.fixture
def setup(config: Path, compiled_only: None) -> Setup:
    return setup_of(trial_of(config))


def test_forced_panel_keeps_the_vertical_angle() -> None:
    loaded = on_one_panel(loads(MOVING), (960, 540))
    wall = expand(loaded.config.wall)
    assert (len(wall.panels), wall.width, wall.height) == (1, 960, 540)
    assert loaded.config.views[0].camera.fov == 40


def test_eye_before_the_wall_becomes_the_angle_that_it_saw() -> None:
    text = MOVING.replace(", fov: 40}", "}, eye: [0.1, 0, 0.15]")
    loaded = on_one_panel(loads(text), (64, 64))  # 0.3 m high at 0.15 m: 90 degrees
    assert loaded.config.views[0].eye is None
    assert loaded.config.views[0].camera.fov == pytest.approx(90.0)


def test_every_second_refresh_has_an_reference_image_and_every_eighth_of_large_ones() -> None:
    small = reference_refreshes((256, 256), seconds=4.0, refresh_hz=60.0)
    assert (small[:3], small[-1], len(small)) == ((0, 2, 4), 240, 121)
    assert reference_refreshes((960, 540), seconds=0.4, refresh_hz=60.0) == (0, 8, 16, 24)


def test_reference_image_is_what_wall_render_gives_rounded_to_half_precision(setup: Setup) -> None:
    reference = Reference(setup.plan, setup.tracer_scene, [0.0, 0.5], spp=4)
    reference.make(reference.missing())
    rendered = render(setup.plan, spp=4, seed=SEED, at=0.5)
    assert rendered is not None
    assert reference.image(1) == pytest.approx(rendered, rel=HALF_WAY, abs=1e-7)


def test_reference_images_are_kept_in_the_users_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "wall" / "quality"


def test_reference_images_are_made_once_and_found_again(setup: Setup) -> None:
    times = [0.0, 0.1, 0.2]
    first = Reference(setup.plan, setup.tracer_scene, times, spp=1)
    assert first.missing() == [0, 1, 2]
    first.make([1])
    again = Reference(setup.plan, setup.tracer_scene, times, spp=1)
    assert again.missing() == [0, 2]
    assert np.array_equal(again.image(1), first.image(1))
    assert Reference(setup.plan, setup.tracer_scene, times, spp=2).missing() == [0, 1, 2]
    assert Reference(setup.plan, setup.tracer_scene, [0.0, 0.1, 0.3], spp=1).missing() == [0, 1, 2]


def test_refreshes_between_which_nothing_moves_share_a_image(config: Path, compiled_only: None) -> None:
    text = MOVING.replace(", path: {type: orbit, period_s: 4}", "").replace("courtyard}", "courtyard, animation: []}")
    config.write_text(text)
    still = setup_of(trial_of(config))
    reference = Reference(still.plan, still.tracer_scene, [0.0, 0.1, 0.2], spp=1)
    assert reference.missing() == [0]
    reference.make([0])
    assert reference.missing() == []
    assert reference.image(2).max() > 0.0
    assert np.array_equal(reference.image(0), reference.image(2))


def test_reference_images_of_another_scene_have_another_name(config: Path, setup: Setup) -> None:
    plan = make_plan(make_layout(on_one_panel(loads(MOVING.replace("position: [6,", "position: [6.01,")), SIZE)))
    keys = {Reference(p, setup.tracer_scene, [0.0], spp=1).key for p in (setup.plan, plan)}
    assert len(keys) == 2


def test_reference_images_of_another_lens_have_another_name(config: Path, setup: Setup) -> None:
    def key(lens: str) -> str:
        text = MOVING.replace("courtyard}", "courtyard, integrator: {method: path}}").replace(
            "views: [{", f"views: [{{{lens}"
        )
        plan = make_plan(make_layout(on_one_panel(loads(text), SIZE)))
        return Reference(plan, setup.tracer_scene, [0.0], spp=2).key

    lenses = (
        "",
        "lens: {aperture: 0.1, focus: 8}, ",
        "lens: {aperture: 0.2, focus: 8}, ",
        "lens: {aperture: 0.1, focus: 9}, ",
    )
    assert len({key(lens) for lens in lenses}) == len(lenses)


def test_frame_is_shown_from_its_last_ray_on_with_the_inputs_of_its_beginning(setup: Setup) -> None:
    # 768 pixels at 10 k/s: a frame takes 76.8 ms, so that of the first input is there at the fifth refresh
    method = make_method("framed", setup)
    first, shown = method.show(0.0).copy(), []
    for refresh in range(1, 7):
        method.advance(refresh / 60)
        shown.append(method.show(refresh / 60).copy())
    assert [np.array_equal(image, first) for image in shown] == [True] * 4 + [False] * 2
    assert np.array_equal(shown[4], shown[5])
    assert method.rays == 768


@pytest.mark.parametrize("name", ["framed", "framed_x10", "frameless", "hilbert"])
def test_plain_method_spends_its_rate_and_never_more(setup: Setup, name: str) -> None:
    rate = setup.rate * (10 if name == "framed_x10" else 1)
    method = make_method(name, setup)
    most = 768 + 64 * 2  # a frame, or a batch of two samples a pixel of a chunk, may be under way
    for refresh in range(1, 31):
        method.advance(refresh / 60)
        assert rate * refresh / 60 - most <= method.rays <= rate * refresh / 60 + 1
    assert method.bytes > 3 * method.rays
    assert method.show(0.5).shape == (24, 32, 3)


def test_same_seed_gives_the_same_image_and_another_one_does_not(setup: Setup) -> None:
    def shown(seed: int) -> Float32:
        method = make_method("frameless", replace(setup, seed=seed))
        method.advance(0.05)
        return method.show(0.05)

    assert np.array_equal(shown(1), shown(1))
    assert not np.array_equal(shown(1), shown(2))


def test_progressive_method_converges_to_the_reference_after_a_stop(config: Path, compiled_only: None) -> None:
    path = "{type: keyframes, loop: false, keyframes: [" + ", ".join(
        f"{{time: {t}, position: [{x}, 4, 8], target: [0, 1, 0]}}" for t, x in ((0, 6), (0.1, 7), (0.2, 7), (9, 7))
    )
    config.write_text(
        MOVING.replace("{type: orbit, period_s: 4", path + "]").replace("courtyard}", "courtyard, animation: []}")
    )
    setup = setup_of(trial_of(config, rate=768 * 160.0))
    method = make_method("progressive", setup)
    first = method.show(0.0).copy()
    method.advance(0.09)
    assert method.rays == 0
    assert np.array_equal(method.show(0.09), first)
    method.advance(0.7)
    reference = render(setup.plan, spp=64, seed=SEED, at=0.7)
    assert reference is not None
    assert np.sqrt(np.mean((method.show(0.7) - reference) ** 2)) < 0.1 * np.sqrt(np.mean((first - reference) ** 2))
    assert 60 * 768 <= method.rays <= 100 * 768


def test_missing_extra_is_named_before_anything_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "NEEDED", {"no_such_module_of_ours": "flip-evaluator"})
    with pytest.raises(RunError, match=r"needs flip-evaluator: pip install"):
        command.check_installed()


class Burning:
    """A method whose rays and images take CPU time of a clock turned by hand; rays are traced `frame` at a time."""

    def __init__(self, *, ray_s: float, show_s: float, frame: int = 1, idle_until: float = 0.0) -> None:
        self.rays = self.secondary = self.bytes = 0
        self.cpu, self.ray_s, self.show_s = 0.0, ray_s, show_s
        self._frame, self._idle_until, self._lapsed = frame, idle_until, 0

    def advance(self, until: float, rays: int | None = None) -> None:
        assert rays is not None
        if until <= self._idle_until:
            self._lapsed = rays
            return
        done = (rays - self._lapsed) // self._frame * self._frame
        self.cpu += (done - self.rays) * self.ray_s
        self.rays = done

    def show(self, time: float) -> Float32:
        self.cpu += self.show_s
        return np.full((1, 1, 3), time, np.float32)


def burnt(method: Burning, *, cores: float, refreshes: int, guess: float = 1.0) -> CpuClock:
    clock = CpuClock(
        cores, ray_s=guess * method.ray_s, show_s=guess * method.show_s, image=np.zeros((1, 1, 3), np.float32),
        timer=lambda: method.cpu,
    )  # fmt: skip
    for k in range(refreshes):
        clock.refresh(method, k / 60, (k + 1) / 60)
    return clock


@pytest.mark.parametrize("frame", [1, 5_000, 60_000])  # of 3,100 rays a refresh and core
@pytest.mark.parametrize("guess", [1.0, 0.2, 5.0])
def test_equal_cpu_time_is_spent_whole_whatever_the_first_guess(guess: float, frame: int) -> None:
    method = Burning(ray_s=4e-6, show_s=4e-3, frame=frame)
    clock = burnt(method, cores=2.0, refreshes=240, guess=guess)
    assert clock.spent == pytest.approx(method.cpu)
    under_way = frame * 4e-6
    assert 8.0 * 0.98 - under_way <= clock.spent <= 8.0 * 1.02 + under_way
    assert clock.shown >= 225  # a first guess that is wrong costs some


def test_images_that_cost_more_than_there_is_miss_refreshes_and_leave_a_quarter_to_the_rays() -> None:
    method = Burning(ray_s=1e-6, show_s=50e-3)  # three times a core's refresh
    clock = burnt(method, cores=1.0, refreshes=240)
    assert clock.spent == pytest.approx(4.0, rel=0.05)
    assert 20 <= clock.shown <= 80
    assert method.rays > 1e5


def test_time_that_is_not_used_is_not_saved_up() -> None:
    method = Burning(ray_s=1e-6, show_s=0.0, idle_until=1.0)
    burnt(method, cores=1.0, refreshes=61)
    assert 0 < method.rays <= 2.01e6 / 60


@pytest.mark.parametrize("name", [m for m in METHODS if ":" not in m and not re.match(r"reduced_(?!32$)", m)])
def test_every_method_spends_no_more_than_it_is_allowed_in_all(setup: Setup, name: str) -> None:
    method, allowed = make_method(name, setup), 0
    for refresh in range(1, 13):
        allowed += 50 * refresh  # another rate at each
        method.advance(refresh / 60, allowed)
        shown = method.show(refresh / 60)
        assert method.rays <= allowed + 15  # the last packet may be filled up
    assert shown.shape == (24, 32, 3)
    assert np.isfinite(shown).all()
    assert method.rays >= (0 if name == "progressive" else allowed - 2 * 768)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--methods", "famed"], r"--methods famed: unknown; did you mean framed\?; accepted: adaptive, "),
        (["--rates", "400x"], r"--rates 400x: wanted rays a second"),
        (["--scenes", "orbt"], r"--scenes orbt: unknown; did you mean orbit\?"),
        (["--clock", "wall"], r"--clock wall: no such clock; accepted: virtual, cpu"),
        (["--clock", "cpu", "--methods", "framed_x10"], r"framed_x10: it has ten times the rate"),
        (["--clock", "cpu", "--cores", "0"], r"--cores 0: wanted CPU seconds"),
        (["nowhere.yaml"], r"nowhere\.yaml: no such file"),
    ],
)
def test_what_cannot_be_meant_is_refused(options: list[str], message: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(cli.app, ["measure", "quality", "--out", str(tmp_path), *options])
    assert isinstance(result.exception, ConfigError)
    with pytest.raises(ConfigError, match=message):
        raise result.exception
    assert not list(tmp_path.iterdir())


def test_names_are_picked_by_patterns_and_rates_by_words() -> None:
    assert command.methods_of("framed,*_x1?", clock="virtual") == ("framed", "framed_x10")
    assert command.rates_of("100k,4e5,1.5M,400000") == (1e5, 4e5, 1.5e6)
    assert "framed_x10" not in command.methods_of("", clock="cpu")
    assert not any("tapestry" in name for name in command.methods_of("", clock="virtual"))
    assert command.methods_of("tapestry", clock="virtual") == ("tapestry",)
    assert not [method for method in command.methods_of("", clock="virtual") if ":" in method]
    assert set(command.methods_of("*", clock="virtual")) == set(METHODS)


def test_two_scenes_of_one_name_are_refused(tmp_path: Path) -> None:
    configs = (tmp_path / "a" / "x.yaml", tmp_path / "b" / "x.yaml")
    with pytest.raises(ConfigError, match="two configurations are called x"):
        Wanted(configs=configs, methods=("framed",), out=tmp_path).trials()


def test_second_call_measures_only_what_is_missing(config: Path, tmp_path: Path, compiled_only: None) -> None:
    out = tmp_path / "out"
    always = [
        "measure",
        "quality",
        str(config),
        "--size",
        "32x24",
        "--seconds",
        "0.2",
        "--seeds",
        "1",
        "--rates",
        "20k",
    ]

    def lines(methods: str) -> list[dict[str, object]]:
        result = CliRunner().invoke(cli.app, [*always, "--out", str(out), "--methods", methods])
        assert result.exit_code == 0, result.output
        return [json.loads(line) for line in (out / "quality.jsonl").read_text().splitlines()]

    first = lines("framed")
    both = lines("frameless,framed")
    assert [row["method"] for row in both] == ["framed", "frameless"]
    assert both[0] == first[0]
    assert (out / "summary.json").exists()
    assert (out / "pictures" / "moving" / "32x24-framed-20000-1.png").exists()
    assert len(both[1]["error_over_time"]) == len(both[1]["times"]) == 5  # type: ignore[arg-type]
