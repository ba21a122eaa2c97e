"""The gold-standard experiment: one cell is a scene, an arm, a rate and a seed, run on the virtual clock.

After Woolley et al. 2003 and Dayal et al. 2005: at display refreshes the shown picture is compared with an ideal one
of that very moment, so that late and coarse count alike.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wall.config.loading import Loaded, load
from wall.data import Float32
from wall.errors import ConfigError
from wall.measure.quality import arms, gold, metrics
from wall.measure.quality.arm import Arm, Setup
from wall.processes.plan import make_layout, make_plan
from wall.tracing.resident import make_resident

SECONDS, REFRESH_HZ = 4.0, 60.0
LOOKED_AT = 8  # refreshes a run whose FLIP and SSIM are taken: they are slow
SCORED_PIXELS = 120 * 256 * 256  # a run's ideal pictures hold about so many: every 2nd refresh at 256x256
SETTLE_S = 0.05  # after the start, which is free for everybody, nothing is compared


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    scene: str
    arm: str
    rate: float
    seed: int
    width: int
    height: int
    clock: str = "virtual"  # or "cpu": as many rays as fit in `cores` of processor time
    cores: float = 1.0
    seconds: float = SECONDS
    refresh_hz: float = REFRESH_HZ

    @property
    def key(self) -> tuple[Any, ...]:
        """What makes a result the same one."""
        rate = self.rate if self.clock == "virtual" else self.cores
        return (self.scene, self.arm, rate, self.seed, self.width, self.height, self.clock, self.seconds)

    @property
    def refreshes(self) -> int:
        return round(self.seconds * self.refresh_hz)

    @property
    def scored(self) -> list[int]:
        """The refreshes that are compared."""
        every = max(2, round(self.width * self.height * self.refreshes / SCORED_PIXELS))
        first = max(1, round(SETTLE_S * self.refresh_hz))
        return [k for k in range(every, self.refreshes + 1, every) if k >= first]


def prepare(config: Path, cell: Cell) -> Setup:
    """Load a configuration onto one flat panel of the cell's size. Raises ConfigError."""
    loaded = resized(load(config), cell.width, cell.height)
    plan = make_plan(make_layout(loaded))
    return Setup(
        plan=plan, resident=make_resident(plan.scene), rate=cell.rate, refresh_hz=cell.refresh_hz, seed=cell.seed
    )


def resized(loaded: Loaded, width: int, height: int) -> Loaded:
    """The same scene and view on one flat panel of so many pixels, 0.3 m high."""
    grid = {"columns": 1, "rows": 1, "pixels": [width, height], "size": [0.3 * width / height, 0.3]}
    data = loaded.config.model_dump(mode="json", exclude_none=True)
    data["wall"], data["graph"] = {"grid": grid}, {"preset": "sort-first", "sinks": ["png"]}
    for view in data["views"]:
        view.pop("eye", None)
    return loaded.with_config(type(loaded.config).model_validate(data))


def run(
    cell: Cell, setup: Setup, ideals: gold.Frames, *, keep: Callable[[int, Float32, Float32], None] | None = None
) -> dict[str, Any]:
    """One row of quality.jsonl. `keep(refresh, ideal, shown)` sees the display values of every compared refresh."""
    arm = arms.ARMS[cell.arm](setup)
    scored, spender = set(cell.scored), Spender(cell)
    linear: list[float] = []
    display: list[float] = []
    looks: list[tuple[float, float]] = []
    flicker: list[float] = []
    shown_before: Float32 | None = None
    every = max(1, len(scored) // LOOKED_AT)
    for k in range(1, cell.refreshes + 1):
        picture = spender.refresh(arm, k / cell.refresh_hz)
        if k not in scored:
            continue
        ideal = np.asarray(ideals[len(display)], np.float32)
        linear.append(metrics.mean_square(picture, ideal))
        shown, wanted = metrics.display_values(picture), metrics.display_values(ideal)
        display.append(metrics.mean_square(shown, wanted))
        if shown_before is not None:
            flicker.append(metrics.mean_square(shown - shown_before, wanted - wanted_before))
        shown_before, wanted_before = shown, wanted
        if len(display) % every == 0:
            looks.append((metrics.flip(wanted, shown), metrics.ssim(wanted, shown)))
        if keep is not None:
            keep(k, wanted, shown)
    rmse = math.sqrt(float(np.mean(display)))
    step = (cell.scored[1] - cell.scored[0]) / cell.refresh_hz
    return {
        "scene": cell.scene, "arm": cell.arm, "rate": cell.rate if cell.clock == "virtual" else arm.rays / cell.seconds,
        "width": cell.width, "height": cell.height, "seed": cell.seed, "clock": cell.clock,
        "rmse": math.sqrt(float(np.mean(linear))), "rmse_display": rmse,
        "flip": float(np.mean([look[0] for look in looks])), "ssim": float(np.mean([look[1] for look in looks])),
        "flicker": math.sqrt(float(np.mean(flicker))),
        "latency_equivalent_ms": 1e3 * _delay(ideals, step, rmse),
        "bytes_per_s": arm.bytes / cell.seconds, "rays": arm.rays, "cpu_s": spender.cpu_s,
        "secondary": arm.secondary, "cores": cell.cores if cell.clock == "cpu" else None, "seconds": cell.seconds,
        "refresh_hz": cell.refresh_hz, "error_over_time": [round(math.sqrt(e), 6) for e in display],
        "scored": cell.scored,
    }  # fmt: skip


def _delay(ideals: gold.Frames, step: float, rmse: float) -> float:
    """latency_equivalent, on every second pixel of the ideal pictures: enough for a mean. -1 where no delay is as bad."""
    small = [metrics.display_values(frame[::2, ::2]) for frame in ideals]
    delay = metrics.latency_equivalent(small, step, rmse)
    return delay if math.isfinite(delay) else -1e-3


class Spender:
    """Gives an arm its rays, by count or by the processor time that they and their picture cost.

    On the cpu clock an arm has `cores` / refresh_hz seconds of processor time a refresh; what a refresh takes too much
    or too little is carried over. How many rays that makes follows from what the last refreshes cost.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell, self._before = cell, 0.0
        self._rays = 0.0
        self._per_ray, self._per_picture = 1e-6, 0.0
        self.cpu_s = 0.0

    def refresh(self, arm: Arm, until: float) -> Float32:
        cell = self._cell
        allowed = None
        if cell.clock == "cpu":
            budget = cell.cores * until - self.cpu_s - self._per_picture
            self._rays += max(0.0, budget / self._per_ray)
            allowed = int(self._rays)
        spent, began = arm.rays, clocks.thread_time()
        arm.advance(until, allowed)
        traced = clocks.thread_time()
        picture = arm.show(until)
        ended = clocks.thread_time()
        self.cpu_s += ended - began
        if arm.rays > spent and until > 2.0 / cell.refresh_hz:
            self._per_ray += 0.2 * ((traced - began) / (arm.rays - spent) - self._per_ray)
            self._per_picture += 0.2 * (ended - traced - self._per_picture)
        if cell.clock == "cpu":
            self._rays = max(self._rays, float(arm.rays))
        return picture


def scene_of(name: str) -> Path:
    """The configuration of one of the project's measuring scenes, or a file."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return path
    shipped = Path(__file__).resolve().parents[3] / "configs" / "measure" / f"{name}.yaml"
    if not shipped.exists():
        known = sorted(p.stem for p in shipped.parent.glob("*.yaml"))
        raise ConfigError(f"--scenes {name}: no such scene; accepted: {', '.join(known)}, or a .yaml file")
    return shipped
