"""All trials of a quality run, in as many processes as there are cores; reference images first."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TypeVar

from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.display.image_file import write_image
from wall.study import json_lines
from wall.study.options import check_names
from wall.study.quality.experiment import reference_of, run
from wall.study.quality.image_strips import LOOKS, REFERENCE, image_path, spent_by
from wall.study.quality.methods import check_method
from wall.study.quality.rows import FILE, Row, identity, read
from wall.study.quality.trial import Trial

CLOCKS = ("virtual", "cpu")
RATES = (100_000.0, 400_000.0, 800_000.0)  # the article's
TRIED = 400_000.0  # rays a second that a method is tried out with before it is given CPU time
SIZE, SEEDS = (256, 256), (1, 2, 3, 4, 5)
IMAGES_A_TASK = 4  # reference images that a process makes in one go
NO_RATE_OF_ITS_OWN = ("framed_x10",)  # methods that are defined by a rate, which the CPU clock does not have

Watch = Callable[[str, int, int], None]  # what is being done, how much is done, of how much
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What a run is to measure: the product of these."""

    configs: tuple[Path, ...]
    methods: tuple[str, ...]
    out: Path
    rates: tuple[float, ...] = RATES
    size: tuple[int, int] = SIZE
    seeds: tuple[int, ...] = SEEDS
    clock: str = "virtual"
    cores: tuple[float, ...] = (1.0, 2.0)  # with clock "cpu", instead of rates: CPU seconds a second
    refresh_hz: float = 60.0
    seconds: float | None = None

    def trials(self) -> list[Trial]:
        """Scene by scene, seed by seed, so that a run that is cut short has whole comparisons. Raises ConfigError."""
        self.check()
        spendings = (
            [(rate, 1.0) for rate in self.rates] if self.clock == "virtual" else [(TRIED, c) for c in self.cores]
        )
        return [
            Trial(
                config=config, method=method, rate=rate, size=self.size, seed=seed, refresh_hz=self.refresh_hz,
                seconds=self.seconds, clock=self.clock, cores=cores,
            )
            for config, seed, (rate, cores), method in product(self.configs, self.seeds, spendings, self.methods)
        ]  # fmt: skip

    def covers(self, row: Row) -> bool:
        """Whether a row can stand in one table with those of this run."""
        return (row.clock, (row.width, row.height), row.refresh_hz) == (self.clock, self.size, self.refresh_hz)

    def check(self) -> None:
        """Raises ConfigError if an option is unknown or does not suit another."""
        for method in self.methods:
            check_method(method)
            if self.clock == "cpu" and method in NO_RATE_OF_ITS_OWN:
                raise ConfigError(f"--methods {method}: it has ten times the rate, and --clock cpu has no rate")
        if self.clock not in CLOCKS:
            raise ConfigError(f"--clock {self.clock}: no such clock; accepted: {', '.join(CLOCKS)}")
        check_names(self.configs)


def sweep(wanted: Wanted, watch: Watch) -> list[Row]:
    """Measure what is not in `wanted.out` yet, and return the rows there that can be compared. Raises ConfigError.

    Those are of the wanted clock, size and refreshes: of earlier calls too, unless their scene has changed since.
    """
    trials = wanted.trials()
    path = wanted.out / FILE
    have = {row.identity for row in read(path)}
    pool = ProcessPoolExecutor(
        _processes(wanted), mp_context=multiprocessing.get_context("fork"), initializer=_ignore_interrupts
    )
    try:
        references = _make_references(pool, trials, watch)
        todo = [trial for trial in trials if identity(trial, references[trial.config]) not in have]
        tasks = [partial(measure, trial, wanted.out if trial.seed == wanted.seeds[0] else None) for trial in todo]
        for done, row in enumerate(_as_completed(pool, tasks), start=1):
            json_lines.append(path, row)
            watch(f"{row.scene} {row.method}", done, len(todo))
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    pool.shutdown()
    now = {config.stem: key for config, key in references.items()}
    rows = json_lines.newest(read(path))
    return [row for row in rows if wanted.covers(row) and row.reference == now.get(row.scene, row.reference)]


def measure(trial: Trial, out: Path | None) -> Row:
    """The row of a trial; some of its images are kept below `out` unless that is None."""
    if out is None:
        return run(trial)
    reference, _ = reference_of(trial)
    looks = {round(share * (len(reference) - 1)): number for number, share in enumerate(LOOKS)}

    def path(method: str, image: int) -> Path:
        spent = spent_by(trial)
        return image_path(out, looks[image], scene=trial.scene, size=trial.size, method=method, spent=spent)

    def look(image: int, time: float, shown: Float32, reference: Float32) -> None:
        if image in looks:
            write_image(path(trial.method, image), shown)
            write_image(path(REFERENCE, image), reference)

    path(REFERENCE, next(iter(looks))).parent.mkdir(parents=True, exist_ok=True)
    return run(trial, look)


def _make_references(pool: ProcessPoolExecutor, trials: Sequence[Trial], watch: Watch) -> dict[Path, str]:
    """Make every reference image that the trials need. Returns the name of each configuration's."""
    first = list({trial.config: trial for trial in reversed(trials)}.values())[::-1]
    keys: dict[Path, str] = {}
    tasks: list[partial[int]] = []
    total = done = 0
    for trial, (key, missing) in zip(first, pool.map(_missing, first), strict=True):
        keys[trial.config] = key
        chunks = [missing[k : k + IMAGES_A_TASK] for k in range(0, len(missing), IMAGES_A_TASK)]
        tasks += [partial(_make, trial, chunk) for chunk in chunks]
        total += len(missing)
    for made in _as_completed(pool, tasks):
        done += made
        watch("reference images", done, total)
    return keys


def _missing(trial: Trial) -> tuple[str, list[int]]:
    reference, _ = reference_of(trial)
    return reference.key, reference.missing()


def _make(trial: Trial, images: list[int]) -> int:
    reference_of(trial)[0].make(images)
    return len(images)


def _as_completed(pool: ProcessPoolExecutor, tasks: Sequence[Callable[[], T]]) -> Iterator[T]:
    """Results as they come; an error of one ends it."""
    waiting: set[Future[T]] = {pool.submit(task) for task in tasks}
    while waiting:
        done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
        yield from (future.result() for future in done)


def _processes(wanted: Wanted) -> int:
    """One a core; with the CPU clock one alone, so that nothing else disturbs what is measured."""
    return 1 if wanted.clock == "cpu" else max(1, min(len(os.sched_getaffinity(0)), len(wanted.trials())))


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of the terminal; the one that asked for the work ends the others, at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
