"""quality.jsonl: one line a trial, appended as it is measured; what is there already is not measured again."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from wall.study import json_lines
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
        return json_lines.line_of(self)


def identity(trial: Trial, reference: str) -> Identity:
    """Of the row that a trial will have, held against the reference images of that name."""
    cores = trial.cores if trial.clock == "cpu" else 0.0
    rate = 0.0 if trial.clock == "cpu" else trial.rate
    return (trial.scene, trial.method, rate, *trial.size, trial.seed, trial.clock, cores, trial.refresh_hz, reference)


def read(path: Path) -> list[Row]:
    """The rows of a file. Raises ConfigError for a line that is not one."""
    return json_lines.read(path, Row)
