"""What `wall plan` does with its options."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from wall.commands.fit import with_share
from wall.config.loading import Loaded, loads
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout, make_plan
from wall.study import options
from wall.study.plan import rates as files
from wall.study.plan.budget import FEWER_SAMPLES, Machines, budget_of
from wall.study.plan.comparison import compare, with_renderers
from wall.study.plan.report import Report
from wall.study.plan.scenarios import simulate, thousand
from wall.study.plan.simulation import Setting
from wall.study.plan.target import TEXTS, Given, of_numbers, of_plan

# what rates are measured on where no configuration is given: one panel, two renderers, a camera that circles
REFERENCE = """version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [480, 270], size: [0.48, 0.27]}}
views:
  - camera: {position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}
    path: {type: orbit, period_s: 20}
    refresh_hz: 30
sampling: {method: adaptive}
graph: sort-first
"""
RUN_S = 8.0  # of a run that a simulation is compared with
RENDERERS = 2  # that rates are measured with
PIXELS_A_CORE = 200_000  # of a wall that costs are measured on: a panel of 480x270 and a half


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is to be planned."""

    loaded: Loaded | None
    given: Given
    machines: Machines
    texts: bool = False  # the texts' walls
    fewer: float = FEWER_SAMPLES
    rates: Path | None = None  # measured before; None: measured now
    simulate_s: float = 0.0  # of a configuration, or of the texts' walls; 0: nothing is simulated
    runs: tuple[int, ...] = ()  # numbers of renderers to compare with


def size_of(text: str | None) -> tuple[float, float] | None:
    """Metres of `WIDTHxHEIGHT`. Raises ConfigError."""
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    try:
        size = float(width), float(height)
    except ValueError:
        size = 0.0, 0.0
    if not (0.0 < size[0] < 1e6 and 0.0 < size[1] < 1e6):
        raise ConfigError(f"--size {text}: wanted WIDTHxHEIGHT in metres, such as 4.8x2.7")
    return size


def runs_of(text: str) -> tuple[int, ...]:
    """Numbers of renderers. Raises ConfigError."""
    return options.counts_of("--runs", text) if text else ()


def plan(wanted: Wanted, say: Callable[[str], None]) -> Report:
    """Work everything out. Raises ConfigError, RunError."""
    machines, loaded = wanted.machines, wanted.loaded
    own = make_plan(make_layout(loaded)) if loaded is not None else None
    targets = [of_plan(own)] if own is not None else list(TEXTS) if wanted.texts else [of_numbers(wanted.given)]
    if wanted.runs and loaded is None:
        raise ConfigError("--runs: wanted a configuration to run")
    if wanted.simulate_s and own is None and not wanted.texts:
        raise ConfigError("--simulate: wanted a configuration, or --texts")
    measured = files.load(wanted.rates) if wanted.rates is not None else _measured(loaded, say)
    budgets = tuple(budget_of(target, measured, machines, wanted.fewer) for target in targets)
    simulated = []
    if wanted.simulate_s and own is not None:
        say("simulating")
        setting = Setting(
            cores=measured.cores, one_machine=not own.layout.graph.hosts, link_bytes_per_s=machines.link_bytes_per_s,
            link_s=machines.link_s, seconds=wanted.simulate_s, warm_up_s=wanted.simulate_s / 4,
        )  # fmt: skip
        simulated.append(simulate(own, measured, setting, name=targets[0].name, scenario="as configured"))
    elif wanted.simulate_s:
        simulated += thousand(measured, machines, say, seconds=wanted.simulate_s)
    found = tuple(compare(loaded, wanted.runs, seconds=RUN_S, say=say)) if loaded is not None else ()
    return Report(rates=measured, machines=machines, budgets=budgets, simulated=tuple(simulated), comparisons=found)


def _measured(loaded: Loaded | None, say: Callable[[str], None]) -> files.Rates:
    """Rates on the configuration's own renderers, up to 64 of them, else on the reference."""
    from wall.study.plan.calibration import MOST_RENDERERS, measure

    if loaded is None:
        loaded = with_renderers(loads(REFERENCE, name="reference", path=Path("reference.yaml")), RENDERERS)
    layout = make_layout(loaded)
    if len(layout.regions) > MOST_RENDERERS:
        raise loaded.error(("graph",), f"{len(layout.regions)} renderers cannot be measured here", "--rates FILE")
    cores = len(os.sched_getaffinity(0))
    share = cores * PIXELS_A_CORE / sum(panel.pixels[0] * panel.pixels[1] for panel in layout.wall.panels)
    if share < 1.0:  # renderers that never keep up would be measured at nothing but that
        try:
            layout = make_layout(with_share(loaded, share))
            say(f"measuring with {share:.0%} of the pixels, about what {cores} cores are for")
        except ConfigError as error:  # a file that fits the panels as they are
            say(f"measuring all pixels, more than {cores} cores are for: {error}")
    return measure(make_plan(layout), say=say)
