"""The compositor: take packets in as they come, refresh what they changed at every display refresh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.data import Counters, Event, Rect
from wall.display.base import PanelPicture
from wall.errors import RemoteProtocolError
from wall.geometry.panels import Panel
from wall.packets.control import Framelet, Heartbeat, parse_control, serialise
from wall.packets.samples import decode, is_samples
from wall.packets.tiling import decode_tiling, is_tiling
from wall.processes.panel import PanelCompositor
from wall.processes.plan import Plan, make_predictor
from wall.processes.renderer import Control, peak_memory
from wall.transport.base import Hub, Link

DRAIN_BYTES = 1 << 20  # taken in at once; more would delay a refresh


class Compositor:
    """The panels of one compositor rank, fed from its hub."""

    def __init__(self, plan: Plan, rank: int, hub: Hub) -> None:
        self.hub, self.counters = hub, Counters()
        self.packets = self.bytes = 0
        self.panels = {k: PanelCompositor(plan, k) for k in plan.layout.panels_of(rank)}
        self.remote = {k: RemotePanel(panel) for k, panel in enumerate(plan.layout.wall.panels) if k not in self.panels}

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
            self.panels[batch.panel].insert(batch)
            return
        if is_tiling(packet):
            tiling = decode_tiling(packet)
            if tiling.panel not in self.panels:
                raise RemoteProtocolError(f"tiles of panel {tiling.panel}, which is another compositor's")
            self.panels[tiling.panel].take_tiling(tiling)
            return
        framelet = parse_control(packet)
        if not isinstance(framelet, Framelet) or framelet.panel not in self.remote:
            raise RemoteProtocolError("neither samples nor tiles nor a framelet of another compositor's panel")
        self.remote[framelet.panel].insert(framelet)

    def refresh(self, event: Event, now: float) -> dict[int, NDArray[np.bool_]]:
        """Bring every panel's display values up to date; the tiles that changed, by panel."""
        return {k: panel.refresh(event, now) for k, panel in self.panels.items()}

    def pictures(self) -> tuple[PanelPicture, ...]:
        """All panels of the wall, in order: own ones, and the newest framelets of the others."""
        shown: dict[int, PanelCompositor | RemotePanel] = {**self.panels, **self.remote}
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
        self._pending = {k: np.zeros(p.tiles, np.bool_) for k, p in self._compositor.panels.items()}
        self._packets = self._bytes = 0
        self._ahead = False  # what is shown is not the newest event yet, but what is expected after it

    def run(self) -> None:
        control, clock = self._control, self._control.clock
        due = clock.now()
        predictor = make_predictor(self._plan)
        while not control.stopped:
            event = control.newest()
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
        for k, dirty in self._compositor.refresh(event, now).items():
            self._pending[k] |= dirty
            if self._pending[k].any() and self._outbox.ready():
                self._send(k)

    def _send(self, k: int) -> None:
        panel = self._compositor.panels[k]
        rect = _bounds(self._pending[k], panel.panel.pixels)
        camera_event, scene_event = panel.buffer.newest_event
        rgb = panel.picture().rgb[rect.y : rect.y + rect.height, rect.x : rect.x + rect.width]
        packet = serialise(Framelet.of(panel=k, rect=rect, rgb=rgb, camera_event=camera_event, scene_event=scene_event))
        self._packets += 1
        self._bytes += len(packet)
        self._pending[k][:] = False
        for dropped in self._outbox.offer(packet):
            lost = parse_control(dropped)
            if isinstance(lost, Framelet):
                self._pending[lost.panel][_tiles(lost.rect)] = True

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
    x, y = int(columns[0]) * 16, int(rows[0]) * 16
    return Rect(
        x=x,
        y=y,
        width=min((int(columns[-1]) + 1) * 16, pixels[0]) - x,
        height=min((int(rows[-1]) + 1) * 16, pixels[1]) - y,
    )


def _tiles(rect: Rect) -> tuple[slice, slice]:
    return slice(rect.y // 16, -(-(rect.y + rect.height) // 16)), slice(rect.x // 16, -(-(rect.x + rect.width) // 16))
