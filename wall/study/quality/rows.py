"""quality.jsonl: one line a trial, appended as it is measured; what is there already is not measured again."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from wall.core.errors import ConfigError
from wall.study.quality.trial import Trial

FILE = "quality.jsonl"

Identity = tuple[object, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What is known of one trial: a line of the file, keys in this order."""

    scene: str
    method: str
    rate: float  # primary rays a second that were asked for; with clock "cpu" that were spent
    width: int
    height: int
    seed: int
    clock: str
    rmse: float
    rmse_display: float
    flip: float | None
    ssim: float | None
    flicker: float
    latency_equivalent_ms: float | None  # None: later than any delay that was tried, or nothing moves
    bytes_per_s: float
    rays: int
    cpu_s: float  # CPU time of advance() and show(), all threads
    secondary: int
    cores: float
    refresh_hz: float
    seconds: float
    shown: int  # refreshes for which the method had CPU time to make an image; all of them with clock "virtual"
    error_over_time: list[float]  # RMSE of display values at each scored refresh
    times: list[float]  # of them, seconds
    still_s: list[float]  # at them, for how long at least nothing had moved
    reference: str  # name of the reference images
    config: str
    ablation: str
    commit: str
    machine: str
    command: str
    bytes_over_time: list[float] = field(default_factory=list)  # sent up to each scored refresh; rows of old lack it
    rays_over_time: list[float] = field(default_factory=list)  # primary rays spent up to then

    @property
    def identity(self) -> Identity:
        """Equal for two rows that are the same trial of the same scene."""
        rate = 0.0 if self.clock == "cpu" else self.rate
        how = (self.clock, self.cores if self.clock == "cpu" else 0.0, self.refresh_hz, self.reference)
        return (self.scene, self.method, rate, self.width, self.height, self.seed, *how)

    def json_line(self) -> str:
        """Returns the row as one line of JSON."""
        return json.dumps({name: _plain(value) for name, value in asdict(self).items()}, allow_nan=False)


def identity(trial: Trial, reference: str) -> Identity:
    """Of the row that a trial will have, held against the reference images of that name."""
    cores = trial.cores if trial.clock == "cpu" else 0.0
    rate = 0.0 if trial.clock == "cpu" else trial.rate
    return (trial.scene, trial.method, rate, *trial.size, trial.seed, trial.clock, cores, trial.refresh_hz, reference)


def append(path: Path, row: Row) -> None:
    """One write of one line, after whatever another run left."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(row.json_line() + "\n")


def read(path: Path) -> list[Row]:
    """The rows of a file, none if it is absent. A line that a killed run left unfinished at the end is cut off.

    Raises ConfigError for any other line that is not a row.
    """
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        path.write_text(whole, encoding="utf-8")
    return [_row(line, f"{path}:{number}") for number, line in enumerate(whole.splitlines(), start=1)]


def newest(rows: Iterable[Row]) -> list[Row]:
    """One row a trial: of several, the last."""
    return list({row.identity: row for row in rows}.values())


def _row(line: str, where: str) -> Row:
    try:
        values = json.loads(line)
        wanted = [f.name for f in fields(Row) if f.name in values or f.default_factory is MISSING]
        return Row(**{name: values[name] for name in wanted})
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"{where}: not a row of a quality run ({error}); move the file, or take another --out"
        ) from None


def _plain(value: Any) -> Any:
    """Floats to eight digits; NaN, which JSON does not know, to null."""
    if isinstance(value, float):
        return float(f"{value:.8g}") if math.isfinite(value) else None
    if isinstance(value, list):
        return [_plain(part) for part in value]
    return value
