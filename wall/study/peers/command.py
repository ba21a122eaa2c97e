"""What the words of `wall measure peers` stand for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from rich.console import RenderableType

from wall.study import options
from wall.study.live.command import configs_of
from wall.study.peers import report as reports
from wall.study.peers.sweep import RENDERERS, Outcome, Wanted, sweep

NEEDED = {"flip_evaluator": "flip-evaluator", "skimage": "scikit-image"}

__all__ = ["report", "sweep", "wanted_of"]


def wanted_of(configs: Iterable[Path], renderers: str, size: tuple[int, int]) -> Wanted:
    """What is to be measured, of renderers by name or pattern. Raises ConfigError, RunError."""
    options.check_installed("wall measure peers", NEEDED)
    return Wanted(
        configs=configs_of(configs), renderers=options.picked("--renderers", renderers, RENDERERS), size=size,
        out=Path("OUT/peers"), cores=(1.0,),
    )  # fmt: skip


def report(outcome: Outcome, out: Path) -> Iterator[RenderableType]:
    """What is printed at the end."""
    if outcome.rows:
        yield from reports.report(outcome.rows, out)
    yield from (f"note: {note}" for note in outcome.notes)
