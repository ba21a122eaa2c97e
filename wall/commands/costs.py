"""What each feature of a scene costs: `wall check` tells memory and fields of packets, `--costs` measures the rest.

A feature is left out of the scene, and the same renderer works on both in turn: whoever else uses the machine takes
from both. Seconds are of the CPU, and of each the least counts, which others disturbed least.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median

from rich.table import Table

from wall.config.loading import Loaded
from wall.roles.plan import Plan, first_event, make_layout, make_plan
from wall.roles.worker import Worker, make_samplers
from wall.run.clock import HeadClock
from wall.scene.build import Scene
from wall.scene.features import Feature, added_one_by_one, features
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

ROUNDS, ROUND_S = 12, 0.1  # that each works, in turn with others
MB = 1e6
WITH_OTHERS = ("relighting", "change detection")  # which go with motion and mirrors


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a sample takes, all of it or what a feature adds."""

    ns: float  # of CPU: choosing, tracing, packing
    bytes: float  # of packets


class Bench:
    """The first renderer of a plan that shows its scene, or another one in its place."""

    def __init__(self, plan: Plan, scene: Scene, laid: TracerScene | None = None) -> None:
        """`laid`: the scene laid out for tracing, where it is already."""
        rank = plan.layout.renderers()[0]
        region = plan.layout.region(rank)
        plan, clock = replace(plan, scene=scene, other_scenes=()), HeadClock()
        samplers = make_samplers(plan, "", region, clock)
        self._worker = Worker(plan, laid or make_tracer_scene(scene), rank, clock, samplers, 0)
        self._event = first_event(plan, 0.0, region.view)
        self._worker.step(self._event)  # which compiles its kernels, or loads them

    def run(self, seconds: float) -> Cost:
        """Work for so long."""
        worker, size = self._worker, 0
        before, began = worker.work.samples, time.thread_time()
        while (passed := time.thread_time() - began) < seconds or worker.work.samples == before:
            packet = worker.step(self._event)
            size += len(packet or b"")
            if packet is None:
                worker.sampler.restart()
        traced = max(worker.work.samples - before, 1)
        return Cost(ns=passed / traced * 1e9, bytes=size / traced)


def compared(one: Bench, other: Bench) -> Cost:
    """What `one` takes more than `other`."""
    a, b = in_turn([one, other])
    return Cost(ns=a.ns - b.ns, bytes=a.bytes - b.bytes)


def in_turn(benches: Sequence[Bench], *, rounds: int = ROUNDS, seconds: float = ROUND_S) -> list[Cost]:
    """What each takes: the least time of many rounds, and bytes in the median."""
    found = [[bench.run(seconds) for bench in benches] for _ in range(rounds)]
    return [
        Cost(ns=min(cost.ns for cost in of_one), bytes=median(cost.bytes for cost in of_one))
        for of_one in zip(*found, strict=True)
    ]


def costs_of(plan: Plan) -> Iterator[tuple[str, Cost]]:
    """What each feature costs that the scene of the first renderer's view has: it is left out in turn.

    Yields names of Feature; those that go with another one are not measured.
    """
    scene = plan.scene_of(plan.layout.region(plan.layout.renderers()[0]).view)
    laid = make_tracer_scene(scene)
    yield "", in_turn([Bench(plan, scene, laid)])[0]
    for feature in features(scene):
        if feature.used and feature.without is not None:
            whole = Bench(plan, scene, laid)  # new each time: samplers work otherwise when they have worked for long
            yield feature.name, compared(whole, Bench(plan, feature.without()))


def table_of(scene: Scene, title: str, costs: dict[str, Cost] | None = None) -> Table:
    """The features that are in: why, and what they take. `costs`: measured, by names of features."""
    table = Table(title=title, title_justify="left")
    for column, right in (("feature", 0), ("because of", 0), ("MB", 1), ("packets bring", 0)):
        table.add_column(column, justify="right" if right else "left")
    for column in ("ns a sample", "bytes") if costs is not None else ():
        table.add_column(column, justify="right")
    for feature in features(scene):
        if feature.used:
            size = f"{feature.bytes / MB:.1f}" if feature.bytes else "0"
            measured = () if costs is None else _measured(feature, costs)
            table.add_row(feature.name, feature.why, size, ", ".join(feature.fields), *measured)
    return table


def left_out(scene: Scene) -> str:
    """The features that the scene does not have, in words."""
    return f"not in the scene, so neither compiled nor sent: {', '.join(f.name for f in features(scene) if not f.used)}"


def _measured(feature: Feature, costs: dict[str, Cost]) -> Sequence[str]:
    cost = costs.get(feature.name)
    if cost is None:
        return "with another" if feature.name in WITH_OTHERS else "", ""
    return f"{cost.ns:+.0f}", f"{cost.bytes:+.2f}"


def one_by_one(loaded: Loaded) -> Table:
    """The scene of a first view with one feature more in each row: what a sample takes, and its memory.

    Raises ConfigError where the configuration is refused.
    """
    plan = make_plan(make_layout(loaded))
    rows = added_one_by_one(plan.scene)
    found = in_turn([Bench(plan, scene) for _, scene in rows])
    table = Table(title="one feature more in each row", title_justify="left")
    for column, right in (("with", 0), ("ns a sample", 1), ("more", 1), ("bytes a sample", 1), ("MB of it", 1)):
        table.add_column(column, justify="right" if right else "left")
    for k, (name, scene) in enumerate(rows):
        mine, before = found[k], found[max(k - 1, 0)]
        size = next((each.bytes for each in features(scene) if each.name == name), 0)
        table.add_row(
            name, f"{mine.ns:.0f}", f"{mine.ns - before.ns:+.0f}" if k else "", f"{mine.bytes:.2f}",
            f"{size / MB:.1f}" if size else "0",
        )  # fmt: skip
    return table
