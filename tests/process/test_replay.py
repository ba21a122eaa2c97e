"""A real run of every sampler, recorded and traced again: the same bits, or a text that says where they differ."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import made_once, wall
from typer.testing import CliRunner

from wall import cli
from wall.commands.film import FilmOfRun, film_of_run, frames_of
from wall.commands.frames import Quality, rendered_frames
from wall.commands.render import render
from wall.commands.replay import replay, replay_one
from wall.config.sampling import METHODS
from wall.core.errors import ConfigError, RunError
from wall.display.film import read_film
from wall.roles.plan import Plan
from wall.roles.renderer_image import RendererImage, image_at
from wall.run.cores import own_cores, quota, share_of_cores
from wall.run.recording import file_of
from wall.run.replay import open_recording, replay_batch
from wall.tracing.tracer_scene import make_tracer_scene

VIEW = "  - {{id: {method}, panels: [r0c{k}], camera: {{position: [6, 4.5, {k}], target: [0, 0.6, 0]}}, {rest}}}\n"
HEAD = """\
version: 1
scene:
  source: courtyard
  cuts: [{position: [0, 0, 1], normal: [0.3, 0, 1]}]
  animation:
    - {type: parameter, name: cuts.0.position, keyframes: [{time: 0, value: [0, 0, 1]}, {time: 1, value: [0, 0, 0]}]}
wall: {grid: {columns: 5, rows: 1, pixels: [48, 32], size: [0.4, 0.3], bezel: 0.01, row_time: 3.0e-4}}
graph: {preset: sort-first, ranks_per_panel: 2, sinks: [png]}
transport: {lost_after_s: 10}
views:
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five views on scanning displays, one a sampler, two ranks each; those of `framed` have two workers."""
    return made_once(tmp_path_factory, "replay", record) / "run.events"


def record(folder: Path) -> None:
    views = [
        VIEW.format(
            method=method,
            k=k,
            rest=f"path: {{type: orbit, period_s: 5}}, sampling: {{method: {method}"
            + (", threads: 2}" if method == "framed" else "}"),
        )
        for k, method in enumerate(METHODS)
    ]
    (folder / "wall.yaml").write_text(HEAD + "".join(views), encoding="utf-8")
    run = wall(
        "run", folder / "wall.yaml", "--headless", "--seconds", 1.5, "--out", folder / "out", "--record",
        folder / "run.events", "--film", folder / "run.mp4", "--film-rate", 4, "--film-spp", 1,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr


def silent(line: str) -> None:
    pass


@pytest.fixture
def copy(recording: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recording, tmp_path / "copy.events"))


def test_every_sampler_gives_the_bits_of_the_run_in_one_process_or_two(recording: Path) -> None:
    done = wall("replay", recording, "--jobs", 2)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("yes") == 10
    said = re.search(r"([\d,]+) samples, each with the bits of the run", done.stdout)
    assert said is not None
    assert int(said.group(1).replace(",", "")) > 10 * 48 * 16
    *_, last = replay(recording, ranks=(1, 10), jobs=1, say=silent)
    assert "samples, each with the bits of the run" in str(last)


def test_a_rank_is_replayed_with_the_cores_that_it_had(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a jump as many pixels are swept first as its share of a core pays for."""
    seen: list[float] = []

    def noting(plan: Plan, *more: Any) -> RendererImage | None:
        seen.append(plan.cores)
        return image_at(plan, *more)

    monkeypatch.setattr("wall.run.replay.image_at", noting)
    opened = open_recording(recording)
    replay_batch(opened, make_tracer_scene(opened.plan.scene), 1, 0)
    assert seen == [share_of_cores(10, [own_cores()] * 11, head=0, limit=quota())]


def test_a_film_of_a_run_has_the_images_of_its_moments(recording: Path, tmp_path: Path) -> None:
    """The third view at 40 Hz, which the run refreshed at 60: its camera is on its path at each moment."""
    plan, moments = frames_of(open_recording(recording), view="frameless", rate=40.0)
    events = [event for (event,) in moments]
    assert len(events) >= 40, "a run of one and a half seconds"
    times = np.array([event.scene_time for event in events if not event.paused])
    assert np.median(np.diff(times)) == pytest.approx(1 / 40)
    assert all(event.camera == plan.view.camera_at(event.scene_time) for event in events)
    some, quality = moments[10:12], Quality(spp=2, seed=1, size=(24, 16))
    frames = rendered_frames(plan, make_tracer_scene(plan.scene), some, quality)
    for (event,), (image, _) in zip(some, frames, strict=True):
        np.testing.assert_array_equal(image, render(plan, spp=2, seed=1, at=event.scene_time, size=(24, 16)))
    film = tmp_path / "run.mp4"
    options = ["--film", str(film), "--rate", "2", "--spp", "1", "--size", "24x16", "--view", "frameless"]
    done = CliRunner().invoke(cli.app, ["replay", str(recording), *options])
    assert done.exit_code == 0, done.output
    assert len(list(read_film(film))) == len(frames_of(open_recording(recording), view="frameless", rate=2.0)[1])


def test_a_run_makes_its_film_and_its_events_stay_until_then(
    recording: Path, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of all views, at its own 4 Hz. Events that were not asked for are gone with the film; else they go on."""
    moments = frames_of(open_recording(recording), view=None, rate=4.0)[1]
    assert [[event.view for event in moment] for moment in moments] == len(moments) * [[0, 1, 2, 3, 4]]
    frames = list(read_film(recording.with_name("run.mp4")))
    assert [frame.shape for frame in frames] == len(moments) * [(32, 248, 3)]
    assert np.ptp(frames[0]) > 100
    film = copy.with_suffix(".mp4")
    with pytest.raises(ConfigError, match=rf"{copy} is there already, .*wall replay {copy} --film {film} makes it"):
        film_of_run(film, None, METHODS, rate=1.0, spp=1)
    with pytest.raises(ConfigError, match=r"--film-view frameles: no such view; accepted: adaptive, .*frameless"):
        film_of_run(film, None, METHODS, rate=1.0, spp=1, view="frameles")
    later = FilmOfRun(film=tmp_path / "no" / "copy.mp4", events=copy, kept=False, rate=1.0, spp=1, view="hilbert")
    with pytest.raises(ConfigError):
        later.make()
    said = capsys.readouterr().err
    assert f"copy.mp4 is not finished; wall replay {copy} --film" in said
    assert "--view hilbert makes it" in said
    replace(later, film=film).make()
    assert (film.exists(), copy.exists()) == (True, False)


def test_one_batch_is_shown_and_written(recording: Path, tmp_path: Path) -> None:
    """One without samples, or that a busy machine did not come to, gives way to the one before; the first has all."""
    for number in range(5, -1, -1):
        try:
            lines = [str(line) for line in replay_one(recording, 3, number, tmp_path / "batch.npy", silent)]
        except RunError as error:
            if f"wanted {number}" in str(error) and number > 0:
                continue
            raise
        assert lines[0].startswith(f"rank 3, batch {number}, worker ")
        if not lines[1].startswith("no sample is shown: "):
            break
    samples = np.load(tmp_path / "batch.npy")
    assert lines[-1] == f"wrote {tmp_path / 'batch.npy'}: {len(samples)} samples"
    assert samples["xy"].max() < 48


def test_another_scene_is_told_with_rank_and_batch(copy: Path) -> None:
    about = json.loads((copy / "run.json").read_text())
    about["config"] = about["config"].replace("source: courtyard", "source: gallery")
    (copy / "run.json").write_text(json.dumps(about))
    with pytest.raises(RunError, match=r"rank 1, batch 0: other samples than in the run, which wall 0\.1\.0 recorded"):
        list(replay(copy, ranks=(1,), jobs=1, say=silent))


def test_files_that_are_not_there_are_named(copy: Path) -> None:
    for rank in range(2, 11):
        file_of(copy, rank).unlink()
    _, note, last = map(str, replay(copy, ranks=(), jobs=1, say=silent))
    assert note.startswith(f"note: not replayed, as {copy} lacks rank-2.events, rank-3.events, ")
    assert "each with the bits of the run" in last


def test_a_run_that_was_killed_is_replayed_up_to_there(copy: Path) -> None:
    path = file_of(copy, 2)
    path.write_bytes(path.read_bytes()[:-200])
    *_, last = replay(copy, ranks=(2,), jobs=1, say=silent)
    assert "each with the bits of the run" in str(last)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"ranks": (0,)}, r"--rank 0: .* has no such renderer; accepted: 1, 2, 3"),
        ({"ranks": (99,)}, r"--rank 99: .*"),
    ],
)
def test_ranks_that_were_not_recorded_are_refused(recording: Path, options: dict[str, tuple[int]], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        list(replay(recording, jobs=1, say=silent, **options))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda about: about | {"format": 9}, "format 9; accepted: 2"),
        (lambda about: {}, "not what `wall run --record` wrote"),
        (lambda about: about | {"at_renderers": [99]}, "not what `wall run --record` wrote"),
        (lambda about: about | {"config": "version: 7"}, "version"),
    ],
)
def test_damaged_recordings_are_refused(copy: Path, change, said: str) -> None:
    path = copy / "run.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(ConfigError, match=said):
        list(replay(copy, ranks=(), jobs=1, say=silent))


def test_a_batch_behind_the_end_is_refused(recording: Path) -> None:
    with pytest.raises(RunError, match=r"rank-2\.events: ends at batch \d+; wanted 1000000"):
        list(replay_one(recording, 2, 10**6, None, silent))
