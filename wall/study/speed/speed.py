"""`wall measure speed`: every speed and memory bar of the project, each as a ratio measured in one run."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from rich.table import Table

from wall.core.errors import ConfigError, WallError
from wall.study.speed import (
    adaptive_cost,
    compositing,
    compositor_tree,
    many_lights,
    mitsuba_peer,
    path_peer,
    paths,
    reconstruction,
    runs,
    tracing,
    wire,
)
from wall.study.speed.record import Row, commit, failed

ROUNDS, QUICK_ROUNDS = 9, 3
SECONDS, QUICK_SECONDS = 6.0, 2.0


def _display_side(name: str, rounds: int, seconds: float) -> list[Row]:
    return adaptive_cost.display_side(name)


# metrics of each group, and what measures them: (rounds, seconds of a run) -> rows. What forks comes first: a small
# process forks quickly.
GROUPS: tuple[tuple[tuple[str, ...], Callable[[int, float], list[Row]]], ...] = (
    (("end_to_end",), lambda rounds, seconds: wire.end_to_end(rounds)),
    (("encrypted",), lambda rounds, seconds: wire.encrypted(rounds)),
    (("encode", "decode"), lambda rounds, seconds: wire.codecs(rounds)),
    (("adaptive_bytes", "adaptive_encode"), lambda rounds, seconds: wire.adaptive_codec(rounds)),
    (("adaptive_overhead", "adaptive_rate"), lambda rounds, seconds: adaptive_cost.rank_side(rounds)),
    *(((name,), partial(_display_side, name)) for name in adaptive_cost.PANELS),
    (("reconstruct_threads",), lambda rounds, seconds: reconstruction.in_threads(rounds)),
    (("trace_framed", "trace_hilbert"), lambda rounds, seconds: tracing.measure(rounds)),
    (("many_lamps", "many_points"), lambda rounds, seconds: many_lights.costs(rounds)),
    (("lamps_noise",), lambda rounds, seconds: many_lights.noise()),
    (("light_tree", "light_tree_move"), lambda rounds, seconds: many_lights.upkeep(rounds)),
    (tuple(f"path_embree{ending}" for ending in paths.SCENES), lambda rounds, seconds: paths.measure(rounds)),
    (path_peer.METRICS, lambda rounds, seconds: path_peer.measure(rounds)),
    (("mitsuba_llvm",), lambda rounds, seconds: mitsuba_peer.measure(rounds)),
    (("compositor_tree",), lambda rounds, seconds: compositor_tree.measure(rounds)),
    (("depth_tree",), lambda rounds, seconds: compositing.depth_tree(rounds)),
    (("depth_copy", "depth_covered"), lambda rounds, seconds: compositing.depth_copy(rounds)),
    (("unchanged_input",), lambda rounds, seconds: compositing.unchanged_input(rounds)),
    (("compositor_cpu",), lambda rounds, seconds: runs.compositor_cpu(seconds)),
    (("input_latency",), lambda rounds, seconds: runs.input_latency(seconds)),
    (("static_bytes",), lambda rounds, seconds: runs.static_bytes(seconds / 2)),
    (("memory_per_rank", "memory_small"), lambda rounds, seconds: runs.memory_per_rank(seconds / 2)),
    (("gpu_refresh",), lambda rounds, seconds: reconstruction.measure(rounds)),  # last: OpenGL and forks do not mix
)
METRICS = (
    "trace_framed", "trace_hilbert", "many_lamps", "many_points", "lamps_noise", "light_tree", "light_tree_move",
    "path_embree", "path_embree_model", *path_peer.METRICS, "mitsuba_llvm", "encode", "decode", "adaptive_bytes",
    "adaptive_encode", "adaptive_overhead", "adaptive_rate", *adaptive_cost.PANELS, "reconstruct_threads", "end_to_end",
    "encrypted",
    "depth_copy", "depth_covered", "unchanged_input", "compositor_tree", "depth_tree", "compositor_cpu",
    "input_latency", "static_bytes", "memory_per_rank", "memory_small",
    "gpu_refresh",
)  # fmt: skip


def measure(only: list[str], *, quick: bool, say: Callable[[str], None]) -> Iterator[Row]:
    """The rows of the wanted metrics (all if `only` is empty), as they are measured. Raises ConfigError."""
    for name in only:
        if name not in METRICS:
            raise ConfigError(f"--only {name}: no such metric; accepted: {', '.join(METRICS)}")
    commit()  # of now: the clone may move on while it is measured
    for names, work in GROUPS:
        wanted = [name for name in names if not only or name in only]
        if not wanted:
            continue
        say(", ".join(names))
        try:
            rows = work(QUICK_ROUNDS if quick else ROUNDS, QUICK_SECONDS if quick else SECONDS)
        except WallError as error:
            rows = [failed(name, str(error)) for name in names]
        except Exception:  # one broken measurement must not lose the others
            rows = [failed(name, traceback.format_exc(limit=-1).strip()) for name in names]
        yield from (row for row in rows if row.metric in wanted)


def write(path: Path, rows: list[Row]) -> None:
    """Rows as JSON lines."""
    path.write_text("".join(row.json_line() + "\n" for row in _ordered(rows)), encoding="utf-8")


def _ordered(rows: list[Row]) -> list[Row]:
    return sorted(rows, key=lambda row: METRICS.index(row.metric))


def table(rows: list[Row]) -> Table:
    """Returns the rows as a table for the terminal."""
    found = Table(title_justify="left")
    for column, right in (("metric", 0), ("value", 1), ("unit", 0), ("limit", 1), ("ratio", 1), ("bar", 0), ("met", 0)):
        found.add_column(column, justify="right" if right else "left", no_wrap=column == "metric")
    for row in _ordered(rows):
        unmet = "skipped" if row.value is None else ""
        met = "FAILED" if row.failed else unmet if row.met is None else "yes" if row.met else "MISSED"
        spread = f" ±{row.spread:.2f}" if row.spread is not None else ""
        ratio = f"{row.ratio:.2f}{spread}" if row.ratio is not None else ""
        found.add_row(row.metric, _figure(row.value), row.unit, _figure(row.limit), ratio, row.bar, met)
    return found


def notes(rows: list[Row]) -> list[str]:
    """What each metric was measured on, a line each."""
    return [f"{row.metric}: {row.note}" for row in _ordered(rows) if row.note]


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
