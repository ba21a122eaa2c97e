"""`wall measure live`: which runs are measured, on which cores, and what is told and shown of them."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.config.sampling import METHODS
from wall.core.errors import ConfigError, RunError
from wall.display.film import read_film, write_film
from wall.study import json_lines
from wall.study.live import cpu_limit, sweep
from wall.study.live.command import methods_of, report, tables
from wall.study.live.cpu_limit import quota_files
from wall.study.live.film import scaled
from wall.study.live.images import GAP, SMALLEST_LABEL, strip
from wall.study.live.rewriting import left_out, load_without_windows, moving, text_for
from wall.study.live.rows import Row
from wall.study.live.runs import busy_ticks
from wall.study.live.sweep import Wanted, cpu_by_role, notes_of

CONFIG = """\
version: 1
scene: {{source: gallery}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [16, 12], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [2.6, 3, 7.1], target: [0, 0.6, -0.3]}}, {view}}}]
sampling: {{method: adaptive, threads: 2, seed: 7}}
graph: {graph}
"""


def config(folder: Path, view: str = "refresh_hz: 30", graph: str = "{preset: sort-first, sinks: [browser]}") -> Path:
    path = folder / "wall.yaml"
    path.write_text(CONFIG.format(view=view, graph=graph), encoding="utf-8")
    return path


def test_windows_that_a_measurement_leaves_out_are_named(tmp_path: Path):
    path = config(tmp_path, graph="{preset: sort-first, sinks: [window]}")
    threads = path.read_text()
    path.write_text(threads.replace(", threads: 2", ""))
    assert left_out(path) == "", "windows show the images as they are"

    path.write_text(path.read_text().replace("0.4, 0.3]", "0.4, 0.3], overlap: 0.05, blend: auto"))
    assert "without blend" in left_out(path)
    assert "p0, p1 travel to a compositor" in left_out(path)

    path.write_text(threads.replace("0.4, 0.3]", "0.4, 0.3], overlap: 0.05, blend: auto"))
    assert left_out(path) == "", "samples of two threads travel anyway"


def test_what_is_measured_has_no_borders():
    loaded = load_without_windows(Path(__file__).parents[3] / "configs/views/map_inset.yaml", several=True)
    assert [view.border for view in loaded.config.views] == [None, None]


def test_each_method_runs_the_same_threads_and_seed_without_windows(tmp_path):
    loaded = load_without_windows(config(tmp_path, "sampling: {method: hilbert, threads: 2, seed: 7}"))

    for method in METHODS:
        found = loads(text_for(loaded, method)).config
        sampling = found.sampling_of(0)
        assert (sampling.method, sampling.threads, sampling.seed) == (method, 2, 7)
        assert found.graph.sinks == ("png",)
        assert sampling.samples_per_batch == (2048 if method in ("adaptive", "progressive") else 4096), (
            "its own default"
        )


def test_camera_orbits_only_where_nothing_moves(tmp_path):
    still = moving(load_without_windows(config(tmp_path)))
    resting = config(tmp_path)
    animation = "scene: {source: gallery, animation: [{type: spin, object: globe, period_s: 2}]}"
    resting.write_text(resting.read_text().replace("scene: {source: gallery}", animation))

    assert still.view.path.type == "orbit"
    assert still.layout.config.views[0].path.type == "orbit"
    assert moving(load_without_windows(resting)).view.path is None


def test_a_graph_that_changes_pictures_is_refused(tmp_path):
    nodes = (
        "{nodes: [{id: s, op: samples, panel: r0c0}, {id: r, op: reconstruct, input: s}, "
        "{id: t, op: samples, panel: r0c1}, {id: q, op: reconstruct, input: t}, {id: w, op: tile, inputs: [r, q]}, "
        "{id: c, op: colour, input: w, gamma: 2.0}, {id: p, op: sink, kind: png, input: c}]}"
    )

    with pytest.raises(ConfigError, match="colour: changes what a panel shows"):
        load_without_windows(config(tmp_path, graph=nodes))


def test_relative_files_are_found_from_another_folder(tmp_path):
    (tmp_path / "ball.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    path = config(tmp_path)
    path.write_text(path.read_text().replace("source: gallery", "source: ball.obj"))

    found = loads(text_for(load_without_windows(path), "framed")).config

    assert found.scene.source == str(tmp_path / "ball.obj")


def test_methods_are_named_or_refused():
    assert methods_of("framed,adaptive") == ("framed", "adaptive")
    assert methods_of("frame*") == ("framed", "frameless")
    with pytest.raises(ConfigError, match=r"--methods framd: unknown.*accepted: adaptive"):
        methods_of("framd")


def test_quota_of_a_fraction_of_a_core():
    assert quota_files(0.25, 2) == [("cpu.max", "2500 10000")]
    assert quota_files(1.5, 1) == [("cpu.cfs_period_us", "10000"), ("cpu.cfs_quota_us", "15000")]
    assert quota_files(0.05, 1)[1] == ("cpu.cfs_quota_us", "1000"), "the kernel takes no less"


def test_cores_that_cannot_be_given_are_refused(monkeypatch):
    monkeypatch.setattr(cpu_limit, "groups_of_this_process", lambda: [])

    with cpu_limit.limited(1.0) as launcher:
        assert launcher[-2:] == [str(min(os.sched_getaffinity(0))), "-"]
    with pytest.raises(RunError, match=r"--cores 0.5: .*no cgroup with a CPU controller.*systemd-run --user"):
        cpu_limit.check(0.5)
    with pytest.raises(ConfigError, match="--cores 1000: this process may use"):
        cpu_limit.check(1000.0)


ROW = Row(
    config="a", method="adaptive", cores=2.0, rmse_display=0.1, flip=0.2, ssim=0.9, refresh_hz=30.0,
    interval_p95_ms=34.0, latency_p50_ms=20.0, latency_p95_ms=30.0, latency_p99_ms=40.0, samples_per_s=4e5,
    bytes_per_s=2e6, cpu_s={"head": 2.0, "renderer": 3.0}, run_s=5.0, seconds=3.0, warm_up_s=2.0, panels=1, pixels=192,
    display_delay_s=0.03, error_over_time=[0.1], times=[2.5], log_cpu_s=0.01, dropped={}, setup="s", reference="r",
    spp=64, other_cores=0.5, commit="c", machine="m", command="wall",
)  # fmt: skip


def test_rows_survive_the_file(tmp_path):
    path = tmp_path / "live.jsonl"
    rows = [ROW, replace(ROW, method="framed"), replace(ROW, rmse_display=0.3)]
    for row in rows:
        json_lines.append(path, row)

    assert json_lines.read(path, Row) == rows
    assert [row.rmse_display for row in json_lines.newest(rows)] == [0.3, 0.1], "the newest of equal ones"


def test_a_disk_without_room_is_told_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep.shutil, "disk_usage", lambda folder: Room(free=10**6))
    plan = moving(load_without_windows(config(tmp_path)))
    bytes_a_wall = 2 * 16 * 12 * 3

    sweep.check_room(plan, Wanted(configs=(), out=tmp_path, seconds=6.0))
    with pytest.raises(RunError, match=r"wall: recordings and reference images may need .* and 1\.00 MB are free"):
        sweep.check_room(plan, Wanted(configs=(), out=tmp_path, seconds=1e6 / 30 / bytes_a_wall))


class Room:
    """Of a disk."""

    def __init__(self, free: int) -> None:
        self.free = free


def test_table_has_codes_and_cores():
    one, other = tables([ROW, replace(ROW, method="framed"), replace(ROW, cores=0.5)])
    line = one.lines[0]

    assert (one.title, other.title) == ("a, 2 cores", "a, 0.5 cores")
    assert [line[0] for line in one.lines] == ["adaptive", "framed"]
    assert line[1] == "25.50"
    assert line[-1] == "0.40, 0.60"


def test_report_tells_what_ran_beside():
    def told(other_cores: float) -> list[object]:
        rows = [replace(ROW, other_cores=other_cores)]
        outcome = sweep.Outcome(rows=rows, failures=[], notes=["a: rests"])
        return [item for item in report(outcome, Path("out")) if isinstance(item, str)]

    assert told(0.05)[0] == "note: a: rests"
    assert "used up to 0.75 cores" in told(0.75)[1]
    assert len(told(0.75)) == len(told(0.05)) + 1


def test_busy_time_is_all_but_idle():
    line = "cpu  100 20 30 4000 500 6 7 8 9 10"

    assert busy_ticks(line.split()) == 100 + 20 + 30 + 6 + 7 + 8


def test_cpu_of_ranks_is_added_by_role():
    ranks = [{"role": "head", "cpu_s": 1.0}, {"role": "renderer", "cpu_s": 2.0}, {"role": "renderer", "cpu_s": 0.5}]

    assert cpu_by_role(ranks) == {"head": 1.0, "renderer": 2.5}


def test_strip_has_a_column_for_each_picture():
    grey = np.full((10, 20, 3), 90, np.uint8)

    found = strip(grey, {"adaptive": (grey, 0.0), "framed": (grey + 10, 10 / 255)})

    assert found.shape == (2 * (10 + 8 * SMALLEST_LABEL // 5), 3 * 20 + 2 * GAP, 3)
    assert (found[-10:, 20 + GAP : 40 + GAP] == 0).all(), "no error"
    assert (found[-10:, -20:] == 30).all(), "three times the error"


def test_film_has_the_images_in_their_order(tmp_path):
    images = [np.full((31, 41, 3), code, np.uint8) for code in (20, 120, 220)]

    write_film(tmp_path / "film.mp4", iter(images), hz=30.0)

    found = list(read_film(tmp_path / "film.mp4"))
    assert [image.shape for image in found] == [(32, 42, 3)] * 3
    assert [round(float(image.mean()), -1) for image in found] == [20, 120, 220]


def test_small_walls_are_enlarged_by_whole_pixels():
    assert scaled(np.zeros((3, 4, 3), np.uint8), 9).shape == (6, 8, 3)
    assert scaled(np.zeros((30, 40, 3), np.uint8), 20).shape == (15, 20, 3)


def test_a_path_that_ends_while_moments_are_compared_is_told(tmp_path):
    keyframes = (
        "path: {type: keyframes, loop: false, keyframes: [{time: 0, position: [1, 2, 3], target: [0, 0, 0]}, "
        "{time: 3, position: [2, 2, 3], target: [0, 0, 0]}]}"
    )
    plan = moving(load_without_windows(config(tmp_path, keyframes)))

    def notes(seconds: float) -> list[str]:
        return notes_of(plan, Wanted(configs=(), out=tmp_path, seconds=seconds, warm_up_s=2.0))

    assert notes(1.0) == []
    assert notes(4.0) == ["wall: the camera rests from 3 s on; moments are compared until 6 s"]


def test_what_was_measured_is_not_measured_again(tmp_path, monkeypatch):
    calls = []

    def measured(wanted, trial, reference):
        calls.append(trial.method)
        return replace(ROW, config="wall", method=trial.method, cores=1.0, setup=trial.setup, reference=reference.key)

    first = swept(tmp_path, monkeypatch, measured)
    again = swept(tmp_path, monkeypatch, measured)
    swept(tmp_path, monkeypatch, measured, seconds=3.0)

    assert again.rows == first.rows
    assert calls == [*METHODS, *METHODS], "once, and once more for another length"


def swept(folder, monkeypatch, measured, **options):
    monkeypatch.setattr(sweep, "measure", measured)
    monkeypatch.setattr(sweep, "compose", lambda folder, rows: None)
    wanted = Wanted(configs=(config(folder),), out=folder / "out", moments=1, spp=1, **options)
    return sweep.sweep(wanted, lambda *_: None)


def test_a_run_that_fails_keeps_no_other_from_being_measured(tmp_path, monkeypatch):
    def measured(wanted, trial, reference):
        if trial.method == "framed":
            raise RunError("silent for 9 s")
        return replace(ROW, config=trial.config, method=trial.method, cores=trial.cores)

    outcome = swept(tmp_path, monkeypatch, measured)

    assert outcome.failures == ["wall, 1 cores, framed: silent for 9 s"]
    assert [row.method for row in outcome.rows] == ["adaptive", "frameless", "hilbert", "progressive"]
    assert json_lines.read(tmp_path / "out" / "live.jsonl", Row) == outcome.rows
