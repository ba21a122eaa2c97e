"""How the run is doing: the table of ranks, the viewer's numbers, what summary.json holds."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wall.config.sampling import METHODS
from wall.core.data import Event
from wall.display.base import LATENCY_LIMITS_S, ParameterState, RankStatus, RankTotals, Status
from wall.packets.control import Heartbeat, Hello, Selection, Statistics
from wall.roles.plan import Layout, Plan
from wall.roles.slowness import why_slow
from wall.roles.stale import marked_places

if TYPE_CHECKING:
    from wall.roles.compositor import Compositor
    from wall.roles.manager import Manager

LEAST_S = 1e-3  # that a rate is an average of
RECENT_LATENCIES = 240  # shown in the viewer's plot
UNSEEN_EVENTS = 4096  # remembered until a sample of them is shown
MEASURED_LATENCIES = 65536  # kept for the summary
AWAY_FROM_HEAD = Status(
    seconds=0.0, paused=False, sampler="", samplers=(), ranks=(), latency_ms=(0.0, 0.0, 0.0), latencies_ms=(),
    refreshes_per_s=0.0,
)  # fmt: skip  # what sinks away from the head are given: they show what is stale alone


class Rates:
    """How fast some counts grow, averaged over at least `span_s` seconds."""

    def __init__(self, span_s: float) -> None:
        self._span_s, self._then = span_s, -math.inf
        self._counts: tuple[float, ...] = ()
        self._rates: tuple[float, ...] = ()

    def at(self, now: float, *counts: float) -> tuple[float, ...]:
        """Growth a second of each count, as of the last measurement that was long enough after the one before."""
        span = now - self._then
        if span > self._span_s:
            before = self._counts or counts
            self._rates = tuple(max(0, new - old) / span for new, old in zip(counts, before, strict=True))
            self._then, self._counts = now, counts
        return self._rates


class Latency:
    """From an event's input to the refresh that first showed a sample of it, on the head's clock."""

    def __init__(self) -> None:
        self._waiting: dict[int, deque[tuple[tuple[int, int], float]]] = {}  # by view
        self.seconds: deque[float] = deque(maxlen=MEASURED_LATENCIES)
        self.counts, self.sum_s = [0] * (len(LATENCY_LIMITS_S) + 1), 0.0  # of all: see Status.latency_counts

    def published(self, event: Event) -> None:
        """An event is to be shown."""
        waiting = self._waiting.setdefault(event.view, deque(maxlen=UNSEEN_EVENTS))
        waiting.append((event.number, event.input_time))

    def shown(self, number: tuple[int, int], now: float, view: int = 0) -> None:
        """Samples of a view's event, and so of all before it, are shown."""
        waiting = self._waiting.get(view, ())
        while waiting and waiting[0][0] <= number:
            seconds = now - waiting.popleft()[1]
            self.seconds.append(seconds)
            self.counts[bisect_left(LATENCY_LIMITS_S, seconds)] += 1
            self.sum_s += seconds


def samplers_of(plan: Plan) -> tuple[str, ...]:
    """What viewers may choose among: in lock step only the configured one, since others make no frames."""
    return METHODS if plan.layout.graph.sync == "none" else (plan.layout.sampling.method,)


def status_of(
    plan: Plan,
    event: Event,
    beats: Mapping[int, Heartbeat],
    members: Mapping[int, Hello],
    latency: Latency,
    *,
    now: float,
    seconds: float,
    refreshes_per_s: float,
    oldest: Mapping[int, float | None],
    gone: Collection[int] = (),
) -> Status:
    """What sinks may show of the run, but for what people steer: see `steered`.

    `now`: seconds of the head's clock; `seconds`: since it began; `oldest`: age of the oldest sample shown, by layer;
    `gone`: ranks that were in the run, and are not heard of.
    """
    renderers = [beat for rank, beat in beats.items() if plan.layout.role(rank) == "renderer"]
    recent = list(latency.seconds)[-RECENT_LATENCIES:]
    latency_ms = percentiles_ms(recent)
    layout = plan.layout
    members = {rank: member for rank, member in members.items() if rank not in gone}
    living = {rank: beat for rank, beat in beats.items() if rank in members}
    right_ms = 1000.0 * max((beat.right_s for beat in living.values()), default=0.0)  # where images are made,
    right_ms = max(right_ms, latency_ms[0]) if right_ms else 0.0  # and no sooner than first samples are displayed
    return Status(
        seconds=seconds,
        paused=event.paused,
        sampler=event.sampler,
        samplers=samplers_of(plan),
        compare=event.compare,
        compared_per_s=sum(beat.compared_per_s for beat in beats.values()),
        ranks=tuple(_rank_status(layout, k, beats.get(k), oldest, now, known=k in members) for k in range(layout.size)),
        latency_ms=latency_ms,
        latencies_ms=tuple(1000.0 * s for s in recent),
        refreshes_per_s=refreshes_per_s,
        right_ms=right_ms,
        stale=marked_places(layout, gone),
        slow=why_slow(layout, living),
        samples_per_pixel=min((beat.samples_per_pixel for beat in renderers), default=0),
        error=math.sqrt(sum(beat.square_error for beat in renderers) / max(len(renderers), 1)),
        latency_counts=tuple(latency.counts),
        latency_sum_s=latency.sum_s,
    )


def steered(
    status: Status, parameters: tuple[ParameterState, ...], views: Sequence[Event | None], selection: Selection
) -> Status:
    """A status with what people steer; `views`: the newest event of each."""
    return replace(
        status,
        parameters=parameters,
        view_samplers=tuple("" if each is None else each.sampler for each in views),
        view_paused=tuple(each is not None and each.paused for each in views),
        selected=tuple(selection.names),
        bookmarks=tuple(selection.bookmarks),
    )


def _rank_status(
    layout: Layout, rank: int, beat: Heartbeat | None, oldest: Mapping[int, float | None], now: float, *, known: bool
) -> RankStatus:
    alive, beat = known and beat is not None, beat or Heartbeat(rank=rank, time=0.0)
    renders = layout.role(rank) == "renderer"
    regions = layout.regions_of(rank) if renders else ()
    region = regions[0] if regions else None  # of the first view; its insets are in describe()
    return RankStatus(
        rank=rank,
        role=layout.role(rank),
        panel=layout.panel(region).id if region is not None else "",
        region=layout.describe(rank),
        samples_per_s=beat.samples_per_s,
        bytes_per_s=beat.bytes_per_s,
        oldest_sample_s=oldest.get(region.layer) if region is not None else None,
        dropped=sum(beat.dropped.values()),
        alive=alive,
        memory_mb=beat.memory / 2**20,
        busy_s=beat.busy_s if now - beat.time <= layout.config.transport.lost_after_s else 0.0,
    )


def totals_of(beat: Heartbeat | None, member: Hello | None, now: float) -> RankTotals:
    """What a rank has done by its newest heartbeat; `now`: seconds of the head's clock."""
    host = member.host if member is not None else ""
    if beat is None:
        return RankTotals(host=host)
    return RankTotals(
        host=host,
        process=beat.process,
        seconds=beat.seconds,
        silent_s=max(0.0, now - beat.time),
        samples=beat.samples_traced,
        packets=beat.packets,
        bytes=beat.bytes,
        refreshes=sum(beat.refreshes_of.values()),
        cpu_s=beat.cpu_seconds,
        memory=beat.memory,
        peak_memory=beat.peak_memory,
        credit=beat.credit,
        dropped=beat.dropped,
    )


def percentiles_ms(seconds: list[float]) -> tuple[float, float, float]:
    """Median, 95th and 99th percentile in milliseconds, 0 where nothing was measured."""
    if not seconds:
        return (0.0, 0.0, 0.0)
    p50, p95, p99 = np.percentile(np.array(seconds), [50, 95, 99]) * 1000.0
    return (round(float(p50), 3), round(float(p95), 3), round(float(p99), 3))


def statistics_of(status: Status) -> Statistics:
    """What an `overlay` node may show."""
    return Statistics(
        fps=round(status.refreshes_per_s, 1),
        samples_per_s=float(f"{sum(rank.samples_per_s for rank in status.ranks):.3g}"),
        latency_ms=round(status.latency_ms[0]),
        ranks=sum(rank.alive for rank in status.ranks),
    )


def summary_of(
    manager: Manager, compositor: Compositor, *, now: float, seconds: float, cores: float, ended: str
) -> dict[str, Any]:
    """What summary.json holds: counts since the newest configuration was adopted.

    `now`: seconds of the head's clock; `seconds`: how long the run took; `cores`: how many the head's process used;
    `ended`: how, where the manager has not decided that. May be called while the threads of both roles run.
    """
    plan, beats = manager.plan, manager.heartbeats.copy()
    layout = plan.layout
    if manager.balancer is not None:
        layout = layout.assigned(manager.balancer.assignment.cuts)
    dropped = manager.dropped()
    renderers = [beat for rank, beat in beats.items() if layout.role(rank) == "renderer"]
    others = [beat for rank, beat in beats.items() if layout.role(rank) != "renderer"]
    layers = compositor.composition.layers.values()
    at_renderers = {layout.wall.viewports[layer.panel].id for layer in layout.graph.layers if layer.at_renderer}
    return {
        "seconds": round(seconds, 3),
        "ended": manager.ended or ended,
        "samples_traced": sum(beat.samples_traced for beat in beats.values()),
        "samples_shown": sum(beat.samples_shown for beat in beats.values()),
        "secondary_rays": sum(beat.secondary_rays for beat in beats.values()),
        "packets": sum(beat.packets for beat in renderers),
        "bytes": sum(beat.bytes for beat in renderers),
        "framelet_bytes": sum(beat.bytes for beat in others),
        "refreshes": round(compositor.refreshes, 2),
        "head_cores": round(cores, 3),
        "reconstruction": dict.fromkeys(sorted(at_renderers), "cpu (at its renderer)")
        | {layer.panel.id: str(choice) for layer in layers if (choice := layer.reprojected.choice)},
        "dropped": dict(sorted(dropped.items())),
        "latency_ms": dict(zip(("p50", "p95", "p99"), percentiles_ms(list(compositor.latency.seconds)), strict=True)),
        "silences": {str(rank): round(s, 2) for rank, s in sorted(manager.register.silences.items())},
        "busy_s": {
            str(rank): round(s, 2)
            for rank, s in sorted(manager.register.busy.copy().items())
            if s > layout.config.transport.lost_after_s
        },
        "stale_s": {str(rank): round(s, 2) for rank, s in manager.register.marked_s(now).items()},
        "restarts": {str(rank): how for rank, how in sorted(manager.register.restarts.items())},
        "lost": {str(rank): how for rank, how in sorted(manager.register.missed(beats).items())},
        "views": [_view_summary(plan, k, list(beats.values())) for k in range(len(plan.views))],
        "configurations": manager.configurations,
        "scene": {
            "updates": manager.taken.updates,
            "edits": manager.taken.edits,
            "edits_together": manager.taken.together,
            "updates_shown": sum(beat.updates_shown for beat in beats.values()),
            "updates_shared": sum(beat.updates_shared for beat in beats.values()),
        },
        "assignments": 0 if manager.balancer is None else manager.balancer.made,
        "ranks": [_rank_summary(layout, k, beats.get(k), manager.register.members.get(k)) for k in range(layout.size)],
    }


def _view_summary(plan: Plan, view: int, beats: Sequence[Heartbeat]) -> dict[str, Any]:
    """Rates of a view, and its share of the time that renderers spent on all views."""
    name = plan.views[view].id
    makers = [beat for beat in beats if name in beat.refreshes_of and beat.seconds > 0.0]
    renderers = [beat for beat in beats if name in beat.samples_of and beat.seconds > 0.0]
    spent = sum(sum(beat.time_of.values()) for beat in renderers)
    rates = [beat.refreshes_of[name] / max(beat.seconds, LEAST_S) for beat in makers]
    return {
        "view": name,
        "refresh_hz": plan.views[view].refresh_hz,
        "refreshes_per_s": round(sum(rates) / max(len(makers), 1), 2),
        "samples_per_s": round(sum(beat.samples_of[name] / max(beat.seconds, LEAST_S) for beat in renderers)),
        "share": round(sum(beat.time_of.get(name, 0) for beat in renderers) / spent, 4) if spent else 0.0,
    }


def _rank_summary(layout: Layout, rank: int, beat: Heartbeat | None, member: Hello | None) -> dict[str, Any]:
    beat = beat or Heartbeat(rank=rank, time=0.0)
    a_second = 1.0 / max(beat.seconds, LEAST_S) if beat.seconds else 0.0
    return {
        "rank": rank,
        "role": layout.role(rank),
        "region": layout.describe(rank),
        "host": member.host if member else "",
        "samples_traced": beat.samples_traced,
        "samples_per_s": round(beat.samples_traced * a_second),
        "bytes_per_s": round(beat.bytes * a_second),
        "peak_memory": beat.peak_memory,
        "cpu_s": round(beat.cpu_seconds, 3),
        "cost": sum(
            beat.costs.values()
        ),  # of a sweep of its region at the end, to compare with other ranks'; 0: not known
        "answers_ms": [round(1e3 * seconds, 3) for seconds in beat.answers],  # to the newest inputs
    }
