"""`wall replay`: trace the samples of a recorded run again, bit for bit, and say so."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from rich.table import Table

from wall.core.errors import ConfigError
from wall.display.files import check_target, replaced
from wall.run.replay import Recorded, Replayed, ReplayedBatch, open_recording, replay_batch, replay_rank
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

_shared: tuple[Recorded, TracerScene] | None = None  # of processes that were forked


def replay(
    folder: Path, *, ranks: tuple[int, ...], jobs: int | None, say: Callable[[str], None]
) -> Iterator[str | Table]:
    """Replay ranks, all if none are named, `jobs` at a time; None: one a core.

    Raises ConfigError for what is no recording, RunError where a sample differs.
    """
    global _shared
    recorded = _opened(folder, ranks)
    ranks = ranks or recorded.ranks
    scene = _scene(recorded, say)
    lives = [(rank, life) for rank in ranks for life in recorded.lives(rank)]
    jobs = min(jobs or len(os.sched_getaffinity(0)), len(lives))
    say(f"replaying {len(ranks)} rank{'s' * (len(ranks) > 1)}")
    began = time.monotonic()
    if jobs == 1:
        replayed = [replay_rank(recorded, scene, *each) for each in lives]
    else:
        _shared = recorded, scene  # forked with the processes
        with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("fork")) as pool:
            replayed = list(pool.map(_replay_shared, *zip(*lives, strict=True)))
    yield _table(recorded, replayed)
    if len(ranks) == len(recorded.ranks) and recorded.missing:
        names = ", ".join(f"rank-{rank}.events" for rank in recorded.missing)
        yield f"note: not replayed, as {folder} lacks {names}"
    samples = sum(each.samples for each in replayed)
    took = f"{time.monotonic() - began:.1f} s in {jobs} process{'es' * (jobs > 1)}"
    yield f"{samples:,} samples, each with the bits of the run; {took}"


def replay_one(
    folder: Path, rank: int, number: int, output: Path | None, say: Callable[[str], None], *, life: int = 0
) -> Iterator[str | Table]:
    """Replay a rank up to one batch, and show that one; `output`: a .npy file for its samples.

    `life`: how often the rank had been started before.
    """
    if output is not None:
        check_target(output, (".npy",))
    recorded = _opened(folder, (rank,))
    if life not in (lives := recorded.lives(rank)):
        raise ConfigError(
            f"--batch {number}@{life}: {folder} has rank {rank} {len(lives)} times; accepted: "
            + ", ".join(f"@{each}" for each in lives)
        )
    found = replay_batch(recorded, _scene(recorded, say), rank, number, life)
    yield from _lines(recorded, rank, found)
    if output is not None and found.batch is not None:
        with replaced(output) as part:
            np.save(part, found.batch.samples)
        yield f"wrote {output}: {len(found.batch.samples)} samples"


def _opened(folder: Path, ranks: tuple[int, ...]) -> Recorded:
    recorded = open_recording(folder)
    for rank in ranks:
        if rank not in recorded.ranks:
            known = ", ".join(map(str, recorded.ranks))
            raise ConfigError(f"--rank {rank}: {folder} has no such renderer; accepted: {known}")
    return recorded


def _scene(recorded: Recorded, say: Callable[[str], None]) -> TracerScene:
    say("building the ray tracing trees")
    scene = make_tracer_scene(recorded.plan.scene)
    warm_up(recorded.plan, scene, say)
    return scene


def _replay_shared(rank: int, life: int) -> Replayed:
    assert _shared is not None
    return replay_rank(*_shared, rank, life)


def _table(recorded: Recorded, replayed: list[Replayed]) -> Table:
    table = Table("rank", "renders", "seconds of the run", "batches", "samples", "as in the run")
    for each in replayed:
        region = recorded.plan.layout.describe(each.rank)
        name = f"{each.rank}, started again ({each.life})" if each.life else str(each.rank)
        table.add_row(name, region, f"{each.seconds:.1f}", f"{each.batches:,}", f"{each.samples:,}", "yes")
    return table


def _lines(recorded: Recorded, rank: int, found: ReplayedBatch) -> Iterator[str]:
    event = found.event
    view = recorded.plan.layout.config.views[event.view].id
    yield (
        f"rank {rank}, batch {found.number}, worker {found.worker}, view {view}: camera event {event.camera_event}, "
        f"scene event {event.scene_event}, scene time {event.scene_time!r} s, sampler {event.sampler}"
    )
    if found.batch is None:
        yield "no sample is shown: nothing was missing, or more has to come first"
        return
    batch, samples = found.batch, found.batch.samples
    yield f"camera: position {batch.camera.position}, rotation {batch.camera.world_from_wall}"
    yield f"traced under camera event {batch.camera_event}, scene time {batch.scene_time!r} s, at {batch.base_time!r} s"
    if not len(samples):
        yield "no sample is shown yet"
        return
    low, high = samples["xy"].min(axis=0), samples["xy"].max(axis=0)
    yield f"{len(samples)} samples in pixels x {low[0]:.3f} to {high[0]:.3f}, y {low[1]:.3f} to {high[1]:.3f}"
    yield f"{batch.skipped} were not finite and are left out"
