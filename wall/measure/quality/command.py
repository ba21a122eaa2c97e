"""`wall measure quality`: from what was asked for to rows, tables and the report."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from wall.errors import ConfigError
from wall.measure.quality import arms, summary
from wall.measure.quality.campaign import Job, measure
from wall.measure.quality.experiment import Cell, scene_of

SCENES = "orbit,shadows,light,mirrors"
CORES = (1.0, 2.0)  # of the cpu clock


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    configs: tuple[tuple[str, Path], ...]  # (name, file) of each scene
    arms: tuple[str, ...]
    rates: tuple[float, ...]
    size: tuple[int, int]
    seeds: int
    clock: str
    seconds: float

    @classmethod
    def parse(
        cls, configs: list[Path], *, scenes: str, arms: str, rates: str, size: tuple[int, int], seeds: int, clock: str,
        seconds: float,
    ) -> Wanted:  # fmt: skip
        """Raises ConfigError for what does not exist or cannot be meant."""
        names = [(path.stem, path) for path in configs]
        names += [(Path(name).stem, scene_of(name)) for name in _split(scenes if scenes or configs else SCENES)]
        if clock not in ("virtual", "cpu"):
            raise ConfigError(f"--clock {clock}: accepted: virtual, cpu")
        chosen = _split(arms)
        check_arms(chosen)
        return cls(
            configs=tuple(names), arms=tuple(chosen), rates=_rates(rates), size=size, seeds=seeds, clock=clock,
            seconds=seconds,
        )  # fmt: skip

    def jobs(self, out: Path) -> list[Job]:
        width, height = self.size
        found = []
        for name, config in self.configs:
            for spent in self.rates if self.clock == "virtual" else CORES:
                for arm in self.arms:
                    for seed in range(1, self.seeds + 1):
                        cell = Cell(
                            scene=name, arm=arm, rate=spent if self.clock == "virtual" else 1e6, seed=seed, width=width,
                            height=height, clock=self.clock, seconds=self.seconds,
                            cores=spent if self.clock == "cpu" else 1.0,
                        )  # fmt: skip
                        found.append(Job(cell=cell, config=config, pictures=out / "pictures" if seed == 1 else None))
        return found


def check_arms(names: list[str]) -> None:
    arms.check(names)


def _split(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _rates(text: str) -> tuple[float, ...]:
    rates = []
    for part in _split(text):
        try:
            rates.append(float(part))
        except ValueError:
            raise ConfigError(f"--rates {part}: wanted rays a second, such as 400000") from None
    if not rates or min(rates) < 1e3:
        raise ConfigError(f"--rates {text}: wanted one or more, at least 1000 rays a second")
    return tuple(rates)


def campaign(wanted: Wanted, out: Path, *, say: Callable[[str, int, int], None]) -> list[dict[str, Any]]:
    """All rows wanted, and the report beside them. The cpu clock has the machine to itself: one run at a time."""
    workers = len(os.sched_getaffinity(0)) if wanted.clock == "virtual" else 1
    rows = list(measure(wanted.jobs(out), out, workers=workers, say=say))
    return rows


def tables(rows: list[dict[str, Any]]) -> list[Table]:
    return [summary.errors_table(rows), summary.ratios_table(rows)]
