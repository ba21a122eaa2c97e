"""The compositor: take packets in as they come, refresh what they changed at every display refresh."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from wall.data import Counters, Event, Rect, Survey
from wall.deepbuffer.kernels import TILE
from wall.display.base import PanelPicture
from wall.errors import RemoteProtocolError
from wall.geometry.panels import Panel
from wall.packets.control import Framelet, Heartbeat, parse_control, serialise
from wall.packets.samples import decode, is_samples
from wall.packets.tiling import decode_tiling, is_tiling
from wall.processes.compared import Compared
from wall.processes.control import Control
from wall.processes.panel import PanelCompositor
from wall.processes.plan import Plan, make_predictor
from wall.processes.usage import peak_memory
from wall.processes.watching import Due
from wall.transport.base import Hub, Link

Dirty: TypeAlias = dict[tuple[int, bool], NDArray[np.bool_]]  # by panel, and whether it is the second picture of two
MOST_APART_S = 60.0  # of a packet's time from the last refresh: more is no delay, but another clock
DRAIN_BYTES = 1 << 20  # taken in at once; more would delay a refresh


class Compositor:
    """The panels of one compositor rank, fed from its hub."""

    def __init__(self, plan: Plan, rank: int, hub: Hub) -> None:
        self.hub, self.counters = hub, Counters()
        self.packets = self.bytes = 0
        self.panels = {k: PanelCompositor(plan, k) for k in plan.layout.panels_of(rank)}
        self.remote = {k: RemotePanel(panel) for k, panel in enumerate(plan.layout.wall.panels) if k not in self.panels}
        self._plan = plan
        self._refreshed: float | None = None  # when, seconds of the head's clock
        self._pool: ThreadPoolExecutor | None = None
        self._remote_compared: dict[int, RemotePanel] = {}  # their second pictures, once there was one
        self._remote_surveys: dict[tuple[int, bool], Survey] = {}  # the newest of each picture

    def follow(self, event: Event) -> None:
        """Begin or end comparing two samplers, if `event` says so."""
        for panel in self.panels.values():
            panel.follow(event)

    def take_in(self) -> int:
        """Fold in what has arrived, at most DRAIN_BYTES of it. Returns packets taken."""
        taken = 0
        for peer, packet in self.hub.drain(DRAIN_BYTES):
            taken += 1
            self.packets += 1
            self.bytes += len(packet)
            try:
                self._insert(packet)
            except RemoteProtocolError:
                self.counters.add("bad_packet")
            self.hub.release(peer, len(packet))
        return taken

    def _insert(self, packet: bytes) -> None:
        if is_samples(packet):
            batch = decode(packet)
            if batch.panel not in self.panels:
                raise RemoteProtocolError(f"samples of panel {batch.panel}, which is another compositor's")
            self._check(batch.rank, batch.panel, batch.rect, batch.base_time)
            self.panels[batch.panel].insert(batch)
            return
        if is_tiling(packet):
            tiling = decode_tiling(packet)
            if tiling.panel not in self.panels:
                raise RemoteProtocolError(f"tiles of panel {tiling.panel}, which is another compositor's")
            self._check(tiling.rank, tiling.panel, tiling.rect, tiling.base_time)
            self.panels[tiling.panel].take_tiling(tiling)
            return
        message = parse_control(packet)
        if not isinstance(message, Framelet | Survey) or message.panel not in self.remote:
            raise RemoteProtocolError("neither samples, tiles nor a framelet or survey of another compositor's panel")
        panel = self.remote[message.panel]
        if isinstance(message, Survey):
            panel.check(message)
            self._remote_surveys[message.panel, message.compared] = message
        elif message.compared:
            self._remote_compared.setdefault(message.panel, RemotePanel(panel.panel)).insert(message)
        else:
            panel.insert(message)

    def _check(self, rank: int, panel: int, rect: Rect, time: float) -> None:
        """Refuse what no rank of this run can have sent: of pixels that are not its own, or of another time."""
        layout = self._plan.layout
        region = layout.region(rank) if rank in layout.renderers() else None
        if region is None or region.panel != panel or not region.rect.holds(rect):
            raise RemoteProtocolError(f"rank {rank}: {rect} of panel {panel}; wanted: inside {region}")
        if self._refreshed is not None and abs(time - self._refreshed) > MOST_APART_S:
            raise RemoteProtocolError(f"rank {rank}: from {time:.6g} s; wanted: about {self._refreshed:.6g} s")

    def refresh(self, event: Event, now: float) -> Dirty:
        """Bring every panel's display values up to date; the tiles that changed."""
        self._refreshed = now
        refreshed = self._in_threads(lambda panel: panel.refresh(event, now))
        dirty = {(k, False): tiles for k, tiles in zip(self.panels, refreshed, strict=True)}
        seconds = {(k, True): p.compared.refresh() for k, p in self.panels.items() if p.compared is not None}
        return dirty | seconds

    def _in_threads(self, work: Callable[[PanelCompositor], NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
        """Of every panel, a core each: kernels release the GIL, and panels share nothing that is written.

        One after the other where one is on a GPU: that picture belongs to the thread that inserts.
        """
        panels = list(self.panels.values())
        workers = min(len(panels), len(os.sched_getaffinity(0)))
        if workers < 2 or any(panel.on_gpu for panel in panels):
            return [work(panel) for panel in panels]
        if self._pool is None:  # not sooner: ranks are forked before anything is refreshed
            self._pool = ThreadPoolExecutor(workers, thread_name_prefix="refresh")
        return list(self._pool.map(work, panels))

    def surveys(self, now: float, *, comparing: bool) -> tuple[Survey, ...]:
        """Of every picture of every panel: made now for own ones, the newest of the others."""
        own = [survey for panel in self.panels.values() for survey in panel.surveys(now)]
        return (*own, *(survey for (_, second), survey in self._remote_surveys.items() if comparing or not second))

    def pictures(self) -> tuple[PanelPicture, ...]:
        """All panels of the wall, in order: own ones, and the newest framelets of the others."""
        shown: dict[int, PanelCompositor | RemotePanel] = {**self.panels, **self.remote}
        return tuple(shown[k].picture() for k in sorted(shown))

    def compared(self) -> tuple[PanelPicture, ...]:
        """The second pictures of all panels, in order; black until something came. None unless two are compared."""
        if any(panel.compared is None for panel in self.panels.values()):
            return ()
        for k, panel in self.remote.items():
            self._remote_compared.setdefault(k, RemotePanel(panel.panel))
        own = {k: panel.compared for k, panel in self.panels.items() if panel.compared is not None}
        shown: dict[int, Compared | RemotePanel] = {**own, **self._remote_compared}
        return tuple(shown[k].picture() for k in sorted(shown))

    def newest_event(self) -> tuple[int, int]:
        """The newest event that has a sample in the picture."""
        numbers = [panel.buffer.newest_event for panel in self.panels.values()]
        numbers += [panel.newest_event for panel in self.remote.values()]
        return max(numbers)

    def samples_shown(self) -> int:
        return sum(panel.buffer.samples_shown for panel in self.panels.values())

    def drops(self) -> Counters:
        total = Counters(dict(self.counters.counts))
        total.merge(self.hub.counters.counts)
        for panel in self.panels.values():
            total.merge(panel.buffer.counters.counts)
        return total


class RemotePanel:
    """A panel that another compositor reconstructs: its framelets, put together."""

    def __init__(self, panel: Panel) -> None:
        self.panel, self.newest_event = panel, (-1, -1)
        self._rgb = np.zeros((panel.pixels[1], panel.pixels[0], 3), np.uint8)
        self._version, self._picture = 0, self._hand_over(0)

    def insert(self, framelet: Framelet) -> None:
        r = framelet.rect
        height, width = self._rgb.shape[:2]
        if r.x + r.width > width or r.y + r.height > height:
            raise RemoteProtocolError(f"framelet {r} reaches outside panel {self.panel.id} of {width}x{height}")
        self._rgb[r.y : r.y + r.height, r.x : r.x + r.width] = framelet.pixels()
        self.newest_event = max(self.newest_event, (framelet.camera_event, framelet.scene_event))
        self._version += 1

    def check(self, survey: Survey) -> None:
        """Raise RemoteProtocolError for a survey whose tiles are not this panel's."""
        height, width = self._rgb.shape[:2]
        if survey.age.shape != (-(-height // TILE), -(-width // TILE)):
            raise RemoteProtocolError(f"survey of {survey.age.shape} tiles, panel {self.panel.id} has {width}x{height}")
        ends = survey.rects[:, :2].astype(np.int64) + survey.rects[:, 2:]
        if (ends > (width, height)).any():
            raise RemoteProtocolError(f"survey: a tile reaches outside panel {self.panel.id} of {width}x{height}")

    def picture(self) -> PanelPicture:
        if self._version != self._picture.version:
            self._picture = self._hand_over(self._version)
        return self._picture

    def _hand_over(self, version: int) -> PanelPicture:
        return PanelPicture(id=self.panel.id, rgb=self._rgb.copy(), screen=self.panel.screen, version=version)


class FurtherCompositor:
    """A compositor beside the head: shows nothing itself, sends framelets of what changed to the head."""

    def __init__(self, plan: Plan, rank: int, hub: Hub, control: Control, outbox: Link) -> None:
        self._plan, self._rank, self._control, self._outbox = plan, rank, control, outbox
        self._compositor = Compositor(plan, rank, hub)
        self._pending: Dirty = {}
        self._survey_due = Due()
        self._packets = self._bytes = 0
        self._ahead = False  # what is shown is not the newest event yet, but what is expected after it

    def run(self) -> None:
        control, clock = self._control, self._control.clock
        due = -math.inf  # the head's time is not known yet
        predictor = make_predictor(self._plan)
        while not control.stopped:
            event = control.newest()
            if event is not None:
                self._compositor.follow(event)
            taken = self._compositor.take_in()
            now = clock.now()
            if now >= due:
                due = max(due + 1.0 / self._plan.view.refresh_hz, now)
                while control.recent:
                    predictor.take(control.recent.popleft())
                if event is not None:
                    expected = predictor.at(now)
                    self._ahead = expected.number != event.number
                    self._refresh(expected, now)
            if control.beat_due():
                control.beat(self._heartbeat(event, last=False))
            if not taken:
                self._compositor.hub.wait(min(0.005, max(0.0, due - now)))
        control.beat(self._heartbeat(control.event, last=True))

    def _refresh(self, event: Event, now: float) -> None:
        refreshed = self._compositor.refresh(event, now)
        for gone in self._pending.keys() - refreshed.keys():
            del self._pending[gone]  # no longer compared
        for shown, dirty in refreshed.items():
            if shown not in self._pending:
                self._pending[shown] = np.full(dirty.shape, shown[1])  # a second picture begins black
            self._pending[shown] |= dirty
            if self._pending[shown].any() and self._outbox.ready():
                self._send(*shown)
        if event.survey and self._outbox.ready() and self._survey_due.now(now):
            for survey in self._compositor.surveys(now, comparing=True):
                self._offer(serialise(survey))

    def _send(self, k: int, compared: bool) -> None:
        panel, pending = self._compositor.panels[k], self._pending[k, compared]
        second = panel.compared if compared else None
        rect = _bounds(pending, panel.panel.pixels)
        camera_event, scene_event = (second or panel).buffer.newest_event
        rgb = (second or panel).picture().rgb[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width]
        numbers = {"camera_event": max(camera_event, 0), "scene_event": max(scene_event, 0)}  # -1: still black
        pending[:] = False
        self._offer(serialise(Framelet.of(panel=k, rect=rect, rgb=rgb, compared=compared, **numbers)))

    def _offer(self, packet: bytes) -> None:
        self._packets += 1
        self._bytes += len(packet)
        for dropped in self._outbox.offer(packet):
            lost = parse_control(dropped)
            if isinstance(lost, Framelet) and (lost.panel, lost.compared) in self._pending:
                self._pending[lost.panel, lost.compared][_tiles(lost.rect)] = True

    def _heartbeat(self, event: Event | None, *, last: bool) -> Heartbeat:
        c = self._compositor
        return Heartbeat(
            rank=self._rank,
            time=self._control.clock.now(),
            samples_shown=c.samples_shown(),
            packets=self._packets,
            bytes=self._bytes,
            peak_memory=peak_memory(),
            dropped=c.drops().counts,
            complete=not self._ahead and not any(p.any() for p in self._pending.values()),
            camera_event=event.camera_event if event else -1,
            scene_event=event.scene_event if event else -1,
            last=last,
        )


def _bounds(dirty: NDArray[np.bool_], pixels: tuple[int, int]) -> Rect:
    """The pixels of the smallest rectangle of 16-pixel tiles that holds all dirty ones."""
    rows, columns = np.flatnonzero(dirty.any(1)), np.flatnonzero(dirty.any(0))
    x, y = int(columns[0]) * TILE, int(rows[0]) * TILE
    return Rect(
        x=x,
        y=y,
        width=min((int(columns[-1]) + 1) * TILE, pixels[0]) - x,
        height=min((int(rows[-1]) + 1) * TILE, pixels[1]) - y,
    )


def _tiles(rect: Rect) -> tuple[slice, slice]:
    bottom, right = rect.y + rect.height, rect.x + rect.width
    return slice(rect.y // TILE, -(-bottom // TILE)), slice(rect.x // TILE, -(-right // TILE))
