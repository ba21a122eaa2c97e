"""Frames: the images of `wall render` at their moments, in files and in a film; what a recorded run was to show."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from typer.testing import CliRunner

from wall import cli
from wall.commands.film import shown_at
from wall.commands.frames import Targets, parse_frames, rate_of
from wall.commands.render import render
from wall.config.loading import load
from wall.core.data import Camera
from wall.core.errors import ConfigError
from wall.core.tone_mapping import Tone
from wall.display.film import read_film
from wall.display.image_file import display_values
from wall.roles.plan import first_event, make_layout, make_plan

CONFIG = """\
version: 1
scene:
  source: courtyard
  animation:
    - {type: spin, object: knot, period_s: 2}
    - {type: orbit, light: 0, center: [0, 1, 0], period_s: 3}
    - {type: parameter, name: exposure, keyframes: [{time: 0, value: 0}, {time: 1, value: 2}]}
wall: {grid: {columns: 1, rows: 1, pixels: [41, 31], size: [0.41, 0.31]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}, path: {type: orbit, period_s: 5}}]
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "wall.yaml"
    path.write_text(CONFIG)
    return path


def test_frames_are_the_images_of_their_moments(config: Path, compiled_only: None) -> None:
    """Frames 0, 3 and 6 at 8 Hz: the moments 0, 3/8 and 6/8 s, shown 8/3 times a second."""
    folder, film = config.parent, config.parent / "film.mp4"
    options = ["--frames", "0:7:3", "--rate", "8", "--spp", "2", "--film", str(film), "-o", str(folder / "f_###.npy")]
    done = CliRunner().invoke(cli.app, ["render", str(config), *options])
    assert done.exit_code == 0, done.output
    plan = make_plan(make_layout(load(config)))
    images = [render(plan, spp=2, seed=1, at=n / 8) for n in (0, 3, 6)]
    assert sorted(path.name for path in folder.glob("f_*")) == ["f_000.npy", "f_003.npy", "f_006.npy"]
    for path, image in zip(sorted(folder.glob("f_*")), images, strict=True):
        np.testing.assert_array_equal(np.load(path), image)
    assert np.abs(images[0] - images[1]).max() > 0.1, "nothing moves"
    shown = list(read_film(film))
    assert [frame.shape for frame in shown] == [(32, 42, 3)] * 3
    with av.open(str(film)) as opened:
        assert opened.streams.video[0].average_rate == Fraction(8, 3)
    for frame, image, stops in zip(shown, images, (0.0, 0.75, 1.5), strict=True):
        assert image is not None
        wanted = display_values(image, tone=Tone(stops)).mean(axis=(0, 1))
        assert np.abs(frame[:31, :41].mean(axis=(0, 1)) - wanted).max() < 6  # of 255: colours are coded coarsely


def test_time_runs_on_between_events_and_a_steered_camera_stays(config: Path) -> None:
    plan = make_plan(make_layout(load(config)))
    view = plan.view
    start = replace(first_event(plan, 100.0), scene_time=1.0, camera=view.camera_at(1.0))
    second = replace(start, input_time=100.2, scene_time=1.2, camera=view.camera_at(1.2))
    steered = Camera(position=(1.0, 2.0, 3.0), world_from_wall=start.camera.world_from_wall)
    third = replace(second, input_time=100.4, scene_time=1.4, camera=steered)
    paused = replace(third, input_time=100.5, scene_time=1.5, paused=True)
    events = [start, second, third, paused]

    def at(time: float) -> tuple[float, Camera]:
        event = shown_at(view, events, time)
        return event.scene_time, event.camera

    assert at(99.0) == (1.0, start.camera)
    assert at(100.0) == (1.0, start.camera)
    scene_time, camera = at(100.1)
    assert scene_time == pytest.approx(1.1)
    assert camera == view.camera_at(scene_time)
    assert at(100.2) == (1.2, second.camera)
    scene_time, camera = at(100.45)
    assert scene_time == pytest.approx(1.45)
    assert camera == steered
    assert at(107.0) == (1.5, steered)


def test_frames_are_counted_to_the_last_one_included() -> None:
    assert list(parse_frames("3:9:3")) == [3, 6, 9]
    assert list(parse_frames("0:0")) == [0]
    assert rate_of(30.0, 2) == 15
    assert rate_of(24000 / 1001) == Fraction(24000, 1001)
    assert Targets(pattern=Path("a/x_####.png")).file(12) == Path("a/x_0012.png")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--frames", "9:3", "-o", "x#.png"], "--frames 9:3: wanted FIRST:LAST"),
        (["--frames", "0:3:0", "-o", "x#.png"], "--frames 0:3:0: wanted"),
        (["--frames", "all", "-o", "x#.png"], "--frames all: wanted"),
        (["--frames", "0:3", "-o", "x.png"], "-o x.png: wanted one #### in the name"),
        (["--frames", "0:3", "-o", "x#y#.png"], "wanted one #### in the name"),
        (["--frames", "0:3", "--film", "x.avi"], "--film x.avi: cannot write '.avi'; accepted: .mp4"),
        (["--frames", "0:3"], "wanted --frames FIRST:LAST, and -o frame_####.png or --film film.mp4"),
        (["--film", "x.mp4"], "wanted --frames FIRST:LAST, and"),
        (["--frames", "0:3", "-o", "x#.png", "--at", "1"], "--frames with --at"),
        (["--frames", "0:3", "-o", "x#.exr", "--layers", "all"], "--frames with --layers"),
        (["--frames", "0:3", "-o", "x#.png", "--rate", "0"], "--rate 0: wanted frames a second"),
        ([], "-o is missing"),
    ],
)
def test_what_makes_no_film_is_refused(config: Path, options: list[str], said: str) -> None:
    done = CliRunner().invoke(cli.app, ["render", str(config), *options])
    assert isinstance(done.exception, ConfigError)
    assert said in str(done.exception)
