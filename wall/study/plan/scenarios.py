"""Simulated walls: what is simulated, and what came of it in a form that tables, figures and JSON show."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from wall.roles.plan import Plan, make_layout, make_plan
from wall.study.plan.budget import FEWER_SAMPLES, Machines
from wall.study.plan.rates import Rates
from wall.study.plan.simulation import Outcome, Setting, Simulation
from wall.study.plan.target import Target, of_plan
from wall.study.plan.walls import THOUSAND, Dealt, config_of

HOPS = ("event travels, batch under way", "batch is traced", "credit and wire", "refresh is due", "image is made")
BUSY = 0.5  # share of its time that a compositor which keeps up spends on refreshes
SECONDS, WARM_UP_S = 1.5, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """A simulated run."""

    name: str
    scenario: str
    target: Target
    images_faster: float  # than a core of the machine that was measured
    outcome: Outcome
    hops_s: tuple[float, ...]  # means of HOPS

    @property
    def share(self) -> float:
        """Samples traced, over those that adaptive sampling needs for the wall's rate."""
        return self.outcome.samples_per_s * FEWER_SAMPLES / (self.target.pixels * self.target.refresh_hz)


def simulate(
    plan: Plan, rates: Rates, setting: Setting, *, name: str, scenario: str = "", images: float = 1.0,
    say: Callable[[float], None] = lambda seconds: None,
) -> Simulated:  # fmt: skip
    """Simulate one run; `images`: see Rates.faster."""
    outcome = Simulation(plan, rates.faster(images=images), setting).run(say)
    trips = outcome.trips
    names = ("input", "traced_from", "traced_until", "arrived", "refreshed", "shown")
    times = np.array([[getattr(trip, one) for one in names] for trip in trips]).reshape(len(trips), len(names))
    hops = tuple(float(x) for x in np.diff(times, axis=1).mean(axis=0)) if trips else (0.0,) * len(HOPS)
    return Simulated(
        name=name, scenario=scenario, target=of_plan(plan), images_faster=images, outcome=outcome, hops_s=hops,
    )  # fmt: skip


def thousand(
    rates: Rates, machines: Machines, say: Callable[[str], None], *, seconds: float = SECONDS
) -> Iterator[Simulated]:
    """The texts' walls with 1,000 ranks: with this machine's cores, then with what makes images in time, a GPU say."""
    cores = max(rates.cores, 2)  # the head's machine has a manager too
    setting = Setting(
        cores=cores, renderers_a_machine=cores, link_bytes_per_s=machines.link_bytes_per_s, link_s=machines.link_s,
        seconds=seconds, warm_up_s=WARM_UP_S * seconds / SECONDS,
    )  # fmt: skip
    for dealt in THOUSAND:
        name = dealt.target.name
        say(f"{name}: placing {dealt.columns * dealt.rows * (1 + dealt.ranks_per_panel):,} ranks")
        plan, own = make_plan(make_layout(config_of(dealt))), rates.with_batch(dealt.batch)
        for scenario, times in (("cores as measured", 1.0), ("images made in time", needed(dealt, own))):
            yield simulate(
                plan, own, setting, name=name, scenario=scenario, images=times,
                say=lambda now, words=f"{name}, {scenario}": say(f"{words}: {now:.1f} s simulated"),  # type: ignore[misc]
            )  # fmt: skip


def needed(dealt: Dealt, rates: Rates) -> float:
    """How many times faster than measured a panel's image has to be made to keep up with the wall's rate."""
    refresh_s = dealt.pixels[0] * dealt.pixels[1] * rates.refresh_pixel_s
    return max(1.0, dealt.target.refresh_hz * refresh_s / BUSY)
