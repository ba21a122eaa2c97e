"""Many cells: run what a folder lacks, a row a line, so that a stopped campaign goes on where it was."""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from wall.data import Float32
from wall.measure.quality import gold
from wall.measure.quality.arm import Setup
from wall.measure.quality.experiment import Cell, prepare, run
from wall.measure.record import command, commit, machine

ROWS = "quality.jsonl"
Row = dict[str, Any]
Say = Callable[[str, int, int], None]  # what, done, of how many


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    cell: Cell
    config: Path
    pictures: Path | None  # where to keep some of the run's pictures, if anywhere


def read_rows(path: Path) -> list[Row]:
    """Rows of earlier calls; a last line that was cut off is left out."""
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    return rows


def key_of(row: Row) -> tuple[Any, ...]:
    """The key of the cell that a row came from."""
    rate = row["rate"] if row["clock"] == "virtual" else row["cores"]
    return (
        row["scene"], row["arm"], rate, row["seed"], row["width"], row["height"], row["clock"], row["seconds"]
    )  # fmt: skip


def measure(jobs: list[Job], out: Path, *, workers: int, say: Say) -> Iterator[Row]:
    """Rows of all jobs: those already in `out`, then the others as they are measured."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / ROWS
    wanted = {job.cell.key for job in jobs}
    there = {key_of(row): row for row in read_rows(path)}
    yield from (row for key, row in there.items() if key in wanted)
    missing = [job for job in jobs if job.cell.key not in there]
    for job in {(j.config, j.cell.width, j.cell.height, j.cell.seconds): j for j in missing}.values():
        _ideal(job, say)
    commit()  # of now: the clone may move on while it is measured
    about = {"command": command(), "machine": machine(), "commit": commit()}
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(workers, mp_context=context) as pool, path.open("a", encoding="utf-8") as file:
        running = {pool.submit(_run, job): job for job in missing}
        for done, future in enumerate(as_completed(running), start=1):
            row = {**future.result(), **about}
            file.write(json.dumps(row) + "\n")
            file.flush()
            job = running[future]
            say(f"{job.cell.scene} {job.cell.arm} {job.cell.rate:.0f}/s", done, len(missing))
            yield row


def _ideal(job: Job, say: Say) -> None:
    def progress(done: int, total: int) -> None:
        say(f"ideal pictures of {job.cell.scene}", done, total)

    gold.ideal(_setup(job.config, job.cell), _times(job.cell), progress=progress)


def _times(cell: Cell) -> list[float]:
    return [k / cell.refresh_hz for k in cell.scored]


def _setup(config: Path, cell: Cell) -> Setup:
    plan = _loaded(config, cell.width, cell.height)
    return Setup(plan=plan.plan, resident=plan.resident, rate=cell.rate, refresh_hz=cell.refresh_hz, seed=cell.seed)


@lru_cache(maxsize=2)
def _loaded(config: Path, width: int, height: int) -> Setup:
    return prepare(config, Cell(scene="", arm="", rate=1.0, seed=1, width=width, height=height))


def _run(job: Job) -> Row:
    setup = _setup(job.config, job.cell)
    ideals = gold.ideal(setup, _times(job.cell), progress=lambda done, total: None)
    keep = _keeper(job) if job.pictures is not None else None
    return run(job.cell, setup, ideals, keep=keep)


def _keeper(job: Job) -> Callable[[int, Float32, Float32], None]:
    """Keep the picture in the middle of a run as PNG, and the ideal one."""
    scored, folder = job.cell.scored, job.pictures
    assert folder is not None
    middle = min(scored, key=lambda k: abs(k - 0.3 * job.cell.refreshes))
    folder.mkdir(parents=True, exist_ok=True)
    cell = job.cell

    def keep(k: int, ideal: Float32, shown: Float32) -> None:
        if k == middle:
            name = f"{cell.scene}_{cell.width}x{cell.height}"
            _save(folder / f"{name}_{cell.arm.replace(':', '_')}_{cell.rate:.0f}_{cell.clock}.png", shown)
            _save(folder / f"{name}_ideal.png", ideal)

    return keep


def _save(path: Path, display: Float32) -> None:
    part = path.with_suffix(f".{os.getpid()}.part")
    Image.fromarray(np.round(display * 255).astype(np.uint8)).save(part, format="PNG")
    part.replace(path)
