"""Simulated runs against measured ones on this machine: the same wall with more and more renderers.

`wall run` is started as a user starts it, once for each number of renderers, which share the first panel. What else
the machine did meanwhile is read from /proc/stat and simulated too. Samples travel to the head, as between machines.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wall.compositing.presets import expanded
from wall.config.graph import NodeGraph, PresetGraph, ReconstructNode
from wall.config.loading import Loaded
from wall.config.views import without_borders
from wall.roles.plan import Plan, make_layout, make_plan
from wall.study.live.cpu_limit import own_cores
from wall.study.live.runs import run_anew
from wall.study.plan.calibration import measure
from wall.study.plan.rates import Rates
from wall.study.plan.simulation import Setting, Simulation

BAR = 0.25  # a prediction may be off by so much
LEAST_OTHERS = 0.03  # cores that something else uses: less is the noise of its measurement
WEIGHTS, FITTED = (1.0, 1e6), 9  # between which its weight is sought, and how often it is halved
COMPARED = ("samples_per_s", "packets_per_s", "latency_p50_ms")  # that the bar is set for


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What a run's summary says."""

    samples_per_s: float
    packets_per_s: float
    latency_p50_ms: float
    latency_p95_ms: float
    refreshes_per_s: float
    head_cores: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A run, predicted and measured."""

    renderers: int
    predicted: Figures
    measured: Figures
    others_cores: float  # that something else used meanwhile
    rates: Rates

    def ratio(self, name: str) -> float:
        """Predicted over measured."""
        measured: float = getattr(self.measured, name)
        return float(getattr(self.predicted, name)) / measured if measured else float("inf")

    def met(self, name: str) -> bool:
        """Whether a prediction is within the bar."""
        return abs(self.ratio(name) - 1.0) <= BAR


def with_renderers(loaded: Loaded, count: int) -> Loaded:
    """The same wall with so many renderers for each panel, whose samples all travel to the head."""
    views = without_borders(loaded.config.views)  # which a preset draws
    wall = make_layout(loaded).wall
    preset = PresetGraph(preset="sort-first", ranks_per_panel=count, sinks=("png",))
    nodes = tuple(
        node.model_copy(update={"on": "head"}) if isinstance(node, ReconstructNode) else node
        for node in expanded(preset, wall, views).nodes
    )
    return loaded.with_config(loaded.config.model_copy(update={"graph": NodeGraph(nodes=nodes), "views": views}))


def compare(
    loaded: Loaded, counts: tuple[int, ...], *, seconds: float, say: Callable[[str], None]
) -> Iterator[Comparison]:
    """Measure the rates of each number of renderers, run them, and simulate the same run. Raises RunError."""
    for count in counts:
        ours = with_renderers(loaded, count)
        plan = make_plan(make_layout(ours))
        say(f"measuring rates, {count} renderers")
        rates = measure(plan)
        say(f"running {count} renderers for {seconds:g} s")
        summary, others = _run(ours, seconds)
        yield Comparison(
            renderers=count, predicted=predict(plan, rates, seconds=seconds, others_cores=others),
            measured=figures_of(summary), others_cores=others, rates=rates,
        )  # fmt: skip


def predict(plan: Plan, rates: Rates, *, seconds: float, others_cores: float = 0.0) -> Figures:
    """The summary of a simulated run on this machine.

    What else it did is simulated as one task a core that always wants it, of a weight with which it gets what it got.
    """
    low, high, weight = *WEIGHTS, 0.0
    simulation = _simulated(plan, rates, seconds, weight)
    for _ in range(FITTED if others_cores > LEAST_OTHERS else 0):
        weight = math.sqrt(low * high)
        simulation = _simulated(plan, rates, seconds, weight)
        low, high = (low, weight) if simulation.others_cores > others_cores else (weight, high)
    return figures_of(simulation.finish())


def _simulated(plan: Plan, rates: Rates, seconds: float, others_weight: float) -> Simulation:
    setting = Setting(cores=rates.cores, one_machine=True, seconds=seconds, others_weight=others_weight)
    simulation = Simulation(plan, rates, setting)
    simulation.run()
    return simulation


def figures_of(summary: dict[str, Any]) -> Figures:
    """Of a summary, as `wall run` writes it. Rates are sums of the renderers' own."""
    renderers = [rank for rank in summary["ranks"] if rank["role"] == "renderer"]
    samples = sum(rank["samples_per_s"] for rank in renderers)
    traced = sum(rank["samples_traced"] for rank in renderers)
    return Figures(
        samples_per_s=samples, packets_per_s=summary["packets"] * samples / max(traced, 1),
        latency_p50_ms=summary["latency_ms"]["p50"], latency_p95_ms=summary["latency_ms"]["p95"],
        refreshes_per_s=summary["refreshes"] / summary["seconds"], head_cores=summary["head_cores"],
    )  # fmt: skip


def _run(loaded: Loaded, seconds: float) -> tuple[dict[str, Any], float]:
    """The summary of a headless run, and the cores that something else used meanwhile."""
    with tempfile.TemporaryDirectory() as folder:
        run = run_anew(loaded, loaded.config.sampling_of(0).method, Path(folder) / "run", seconds=seconds)
    ours = sum(rank["cpu_s"] for rank in run.summary["ranks"]) / run.summary["seconds"]  # the start is out
    return run.summary, max(0.0, min(run.other_cores, own_cores() - ours))
