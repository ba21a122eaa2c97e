"""Rank 0: the manager's thread, a compositor, the sinks, and an eye on everyone else."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from wall.core.data import Event, StatisticsImage
from wall.core.errors import RunError
from wall.display.base import RankStatus, Sink, Status
from wall.display.window import ALL_CLOSED
from wall.operators.overlay import Overlay
from wall.packets.control import Statistics
from wall.roles.compositor import Compositor
from wall.roles.edges import needed_from_others
from wall.roles.manager import Manager, samplers_of
from wall.roles.plan import HEAD, Plan, make_predictor
from wall.roles.statistics import Due
from wall.run.bootstrap import Bootstrap
from wall.run.clock import Clock
from wall.run.sinks import distinct, show_all, window_sink
from wall.run.usage import cpu_seconds, peak_memory
from wall.transport.base import Hub, Link

STATUS_PERIOD_S = 0.25
SETTLED_S = 0.4  # a complete picture that has not changed for this long is final
LAST_S = 2.0  # at the end packets that are on their way are taken in for so long at most
HOLD_S = 0.5  # at the end the last view is held for so long at most, to get all its samples
RECENT_LATENCIES = 240  # shown in the viewer's plot


class Head:
    def __init__(
        self,
        plan: Plan,
        bootstrap: Bootstrap,
        hub: Hub,
        control_hub: Hub,
        clock: Clock,
        links: Mapping[int, Link],
        sinks: list[Sink | None],
        hands: Sequence[Callable[[], list[dict[str, Any]]]],
        *,
        still: bool,
    ) -> None:
        self._plan, self._bootstrap, self._clock, self._sinks = plan, bootstrap, clock, sinks
        self._compositor = Compositor(plan, HEAD, hub, links)
        self.manager = Manager(plan, control_hub, clock, lambda: [c for hand in hands for c in hand()], still=still)
        self._predictor, self._event = make_predictor(plan), self.manager.event
        graph = plan.layout.graph
        self._watches = not graph.layers_on(HEAD) and not needed_from_others(graph, HEAD)  # no samples come here
        self._overlays_elsewhere = any(isinstance(s.node, Overlay) and s.rank != HEAD for s in graph.steps)
        self.lost: dict[int, str] = {}  # ranks that died or went silent: how
        self.silences: dict[int, float] = {}  # the longest a rank was silent, beyond lost_after_s
        self.stopping = ""  # why the run ends, once it does
        self._began, self._cpu = clock.now(), cpu_seconds()
        self._changed = self._began
        self._refreshes = 0
        self._status: Status | None = None
        self._status_due = 0.0
        self._statistics_images: tuple[StatisticsImage, ...] = ()
        self._statistics_due = Due()

    def run(self, *, seconds: float | None, until_complete: bool) -> None:
        """The compositor's loop, until time is up, the picture is complete, or nobody renders any more."""
        self.manager.start()
        clock, period = self._clock, 1.0 / self._plan.view.refresh_hz
        due = clock.now()
        while not self.stopping:
            event = self._newest()
            taken = self._compositor.take_in()
            self._compositor.send()
            now = clock.now()
            if now >= due:
                due = max(due + period, now)
                self._refresh(now, event, self._predictor.at(now))
                self._watch(now)
                if closed := self._closed():
                    self.stopping = closed
                elif seconds is not None and now - self._began >= seconds:
                    self.stopping = "time is up"
                elif until_complete and self._complete(now, event):
                    self.stopping = "complete"
            if not taken:
                self._compositor.hub.wait(max(0.0, min(0.02, due - clock.now())))

    def _closed(self) -> str:
        """Why hands at windows ended the run, "" if they did not: Escape in any of them, or none is left anywhere."""
        own, closed = window_sink(self._sinks), set(self.manager.closed)
        if own is not None and own.gone:
            closed.add(HEAD)
        pressed = (own.escape if own else "") or self.manager.escape
        left = self.manager.window_ranks - closed - self.lost.keys()
        return pressed or (ALL_CLOSED if closed and not left else "")

    def finish(self) -> None:
        """Complete the last view if that takes no time, stop everyone, show what came in, close the sinks."""
        if self.manager.is_alive() and self.stopping != "no renderer is left":
            self._hold()
        self.manager.stop()
        event = self._newest()
        limit = self._clock.now() + LAST_S
        while self._compositor.take_in() and self._clock.now() < limit:
            pass
        self._refresh(self._clock.now(), event, event, force=True)
        failures = []
        for sink in distinct(self._sinks):
            try:
                sink.close()
            except RunError as error:  # one full disk must not keep the others from closing
                failures.append(str(error))
        if failures:
            raise RunError("; ".join(failures))

    def _hold(self) -> None:
        """Freeze the view, so that wall.png shows one moment with every sample."""
        self.manager.hold()
        limit, due = self._clock.now() + HOLD_S, 0.0
        while (now := self._clock.now()) < limit and not self._idle(event := self._newest()):
            if now >= due:  # samples of the frozen view are kept only where they are in the picture
                due = now + 1.0 / self._plan.view.refresh_hz
                self._refresh(now, event, self._predictor.at(now))
            self._compositor.send()  # what others make of it is part of the picture
            if not self._compositor.take_in():
                self._compositor.hub.wait(0.005)

    def _newest(self) -> Event:
        """The newest event. Read once a refresh and handed on: the manager's thread goes on to the next meanwhile."""
        recent = self.manager.recent
        while recent:
            self._event = recent.popleft()
            self._predictor.take(self._event)
        self._compositor.follow(self._event)
        return self._event

    def _statistics_image(self, now: float, event: Event) -> None:
        """Look at the samples for whoever watches them."""
        if not event.statistics:
            self._statistics_images = ()
        elif self._statistics_due.now(now):
            self._statistics_images = self._compositor.statistics_images(now, comparing=bool(event.compare))

    def _refresh(self, now: float, event: Event, expected: Event, *, force: bool = False) -> None:
        """Show the samples as `expected` when this refresh is seen; all else is as of `event`."""
        compositor = self._compositor
        changed = bool(compositor.refresh(expected, now, force=force))
        self._statistics_image(now, event)
        if changed or self._refreshes == 0:
            self._changed = now
            self._refreshes += 1
        if now >= self._status_due or self._status is None:
            self._status_due = now + STATUS_PERIOD_S
            self._status = self._status_at(now, event)
            statistics = statistics_of(self._status)
            compositor.say(asdict(statistics))
            if self._overlays_elsewhere:
                self.manager.tell(statistics)
        show_all(
            self._plan, self._sinks, compositor.shown(), event, now, status=self._status,
            compared=compositor.compared(), statistics_images=self._statistics_images,
        )  # fmt: skip
        self.manager.latency.shown(compositor.newest_event, self._clock.now())
        self._release(event)

    def _release(self, event: Event) -> None:
        """In lock step: once every compositor is done with a frame, the next may begin."""
        lockstep = self._compositor.lockstep
        if lockstep is None or lockstep.done < event.number:
            return
        others = range(1, self._plan.layout.graph.compositors)
        beats = [self.manager.heartbeats.get(rank) for rank in others if rank not in self.lost]
        if all(beat is not None and (beat[1].camera_event, beat[1].scene_event) >= event.number for beat in beats):
            self.manager.release(event)

    def _watch(self, now: float) -> None:
        """Notice ranks that died or fell silent; their regions only grow old. End when no renderer is left."""
        if self.manager.failure is not None:
            raise RunError(f"the manager failed: {self.manager.failure!r}") from self.manager.failure
        limit = self._plan.layout.config.transport.lost_after_s
        for rank, how in self._bootstrap.dead().items():
            self.lost.setdefault(rank, f"died ({how}) after {now - self._began:.1f} s")
        silent = self.manager.silent(now, limit)
        for rank, seconds in silent.items():
            self.silences[rank] = max(self.silences.get(rank, 0.0), seconds)
            self.lost.setdefault(rank, f"silent for {seconds:.1f} s")
        for rank in [r for r, how in self.lost.items() if how.startswith("silent") and r not in silent]:
            del self.lost[rank]  # it was only late
        if all(rank in self.lost for rank in self._plan.layout.renderers()):
            self.stopping = "no renderer is left"

    def _complete(self, now: float, event: Event) -> bool:
        """Whether all is traced under `event`, and all of it has been shown for a while."""
        idle = self._idle(event)
        if self._watches and not idle:
            self._changed = now  # elsewhere: all that is known of it are the others' heartbeats
        shown = self._watches or self._compositor.newest_event == event.number
        return idle and shown and now - self._changed >= SETTLED_S

    def _idle(self, event: Event) -> bool:
        """Whether every other living rank says that it has nothing left to do under `event`."""
        for rank in range(1, self._plan.layout.size):
            beat = self.manager.heartbeats.get(rank)
            idle = beat is not None and beat[1].complete and (beat[1].camera_event, beat[1].scene_event) == event.number
            if not idle and rank not in self.lost:
                return False
        return True

    def _status_at(self, now: float, event: Event) -> Status:
        latencies = list(self.manager.latency.seconds)[-RECENT_LATENCIES:]
        return Status(
            seconds=now - self._began,
            paused=event.paused,
            sampler=event.sampler,
            samplers=samplers_of(self._plan),
            compare=event.compare,
            compared_per_s=sum(beat.compared_per_s for _, beat in list(self.manager.heartbeats.values())),
            ranks=tuple(self._rank_status(rank, now) for rank in range(self._plan.layout.size)),
            latency_ms=percentiles_ms(latencies),
            latencies_ms=tuple(1000.0 * s for s in latencies),
            refresh_hz=self._refreshes / max(now - self._began, 1e-3),
        )

    def _rank_status(self, rank: int, now: float) -> RankStatus:
        layout = self._plan.layout
        beat = self.manager.heartbeats.get(rank)
        heartbeat = beat[1] if beat else None
        renders = layout.role(rank) == "renderer"
        panel = layout.region(rank).panel if renders else None
        own = self._compositor.layers.get(layout.region(rank).layer) if renders else None
        return RankStatus(
            rank=rank,
            role=layout.role(rank),
            panel=layout.wall.panels[panel].id if panel is not None else "",
            region=layout.describe(rank),
            samples_per_s=heartbeat.samples_per_s if heartbeat else 0.0,
            bytes_per_s=heartbeat.bytes_per_s if heartbeat else 0.0,
            oldest_sample_s=own.oldest_sample(now) if own else None,
            dropped=sum(heartbeat.dropped.values()) if heartbeat else 0,
            alive=rank == HEAD or (beat is not None and rank not in self.lost),
            memory_mb=(heartbeat.peak_memory if heartbeat else peak_memory() if rank == HEAD else 0) / 2**20,
        )

    def summary(self) -> dict[str, Any]:
        """What summary.json holds."""
        manager, compositor, layout = self.manager, self._compositor, self._plan.layout
        beats = {rank: beat for rank, (_, beat) in manager.heartbeats.items()}
        dropped = compositor.drops()
        dropped.merge(manager.counters.counts)
        for sink in distinct(self._sinks):
            dropped.merge(sink.dropped())
        for beat in beats.values():
            dropped.merge(beat.dropped)
        seconds = self._clock.now() - self._began
        traced = sum(b.samples_traced for b in beats.values())
        return {
            "seconds": round(seconds, 3),
            "ended": self.stopping or "interrupted",
            "samples_traced": traced,
            "samples_shown": compositor.samples_shown() + sum(b.samples_shown for b in beats.values()),
            "secondary_rays": sum(b.secondary_rays for b in beats.values()),
            "packets": sum(b.packets for r, b in beats.items() if layout.role(r) == "renderer"),
            "bytes": sum(b.bytes for r, b in beats.items() if layout.role(r) == "renderer"),
            "framelet_bytes": compositor.sent[1]
            + sum(b.bytes for r, b in beats.items() if layout.role(r) != "renderer"),
            "refreshes": self._refreshes,
            "head_cores": round((cpu_seconds() - self._cpu) / max(seconds, 1e-3), 3),
            "reconstruction": {
                p.panel.id: str(p.reconstruction) for p in compositor.layers.values() if p.reconstruction
            },
            "dropped": dict(sorted(dropped.counts.items())),
            "latency_ms": dict(zip(("p50", "p95", "p99"), percentiles_ms(list(manager.latency.seconds)), strict=True)),
            "silences": {str(rank): round(s, 2) for rank, s in sorted(self.silences.items())},
            "lost": {str(rank): how for rank, how in sorted(self.lost.items())},
            "ranks": [self._rank_summary(rank, beats.get(rank)) for rank in range(layout.size)],
        }

    def _rank_summary(self, rank: int, beat: Any) -> dict[str, Any]:
        layout = self._plan.layout
        hello = self.manager.hellos.get(rank)
        return {
            "rank": rank,
            "role": layout.role(rank),
            "region": layout.describe(rank),
            "host": hello.host if hello else socket.gethostname() if rank == HEAD else "",
            "samples_traced": beat.samples_traced if beat else 0,
            "samples_per_s": round(beat.samples_traced / max(beat.seconds, 1e-3)) if beat and beat.seconds else 0,
            "bytes_per_s": round(beat.bytes / max(beat.seconds, 1e-3)) if beat and beat.seconds else 0,
            "peak_memory": beat.peak_memory if beat else peak_memory() if rank == HEAD else 0,
        }


def percentiles_ms(seconds: list[float]) -> tuple[float, float, float]:
    """Median, 95th and 99th percentile in milliseconds, 0 where nothing was measured."""
    if not seconds:
        return (0.0, 0.0, 0.0)
    p50, p95, p99 = np.percentile(np.array(seconds), [50, 95, 99]) * 1000.0
    return (round(float(p50), 3), round(float(p95), 3), round(float(p99), 3))


def statistics_of(status: Status) -> Statistics:
    """What an `overlay` node may show."""
    return Statistics(
        fps=round(status.refresh_hz, 1),
        samples_per_s=float(f"{sum(rank.samples_per_s for rank in status.ranks):.3g}"),
        latency_ms=round(status.latency_ms[0]),
        ranks=sum(rank.alive for rank in status.ranks),
    )
