"""The graph's edges between processes: framelets go out in parts, only what changed, and come in as framelets.

Inside a process an edge is a shared framelet, and nothing here is needed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

from wall.compositing.executor import Changes, Regions, merged
from wall.compositing.graph import Graph, Step
from wall.core.data import STILL, Event, Framelet, Rect
from wall.packets.control import HEADER_BYTES, serialise
from wall.packets.framelets import HEAD, MAX_RAW, FrameletPart, bands, bytes_a_pixel
from wall.roles.instructions import Offer, Ready, Shares, shares_nothing

APART, HELD = 0.96, 0.3  # of the period: images are shown so far apart, if that holds none back for longer than HELD
Number = tuple[int, int]  # of an event: camera, scene
NEVER: Number = (-1, -1)
NOWHERE = Event(view=0, camera_event=-1, scene_event=-1, scene_time=0.0, input_time=0.0, camera=STILL)


def summed_number(events: Iterable[Event | None]) -> Number:
    """What heartbeats say of the newest events of several views: two sums, which grow with each of them."""
    numbers = [event.number for event in events if event is not None]
    return (sum(camera for camera, _ in numbers), sum(scene for _, scene in numbers)) if numbers else NEVER


class RemoteFramelet:
    """What a node of another process has made, as far as it came.

    Images that come unevenly are shown more evenly, by a playout buffer: one that is early waits, see APART. What comes
    after a pause is not early.
    """

    def __init__(self, step: Step, period_s: float = 0.0) -> None:
        """`period_s`: between images, seconds; 0: each is there as soon as it came."""
        self.step, self._newest = step, dict[int, Number]()  # by view
        self._period_s, self._shown_at = period_s, -math.inf
        self.even_from = -math.inf  # before, seconds of the head's clock, nothing waits
        self.due = math.inf  # when what waits is shown, seconds of the head's clock; never where nothing does
        self._early: list[FrameletPart] = []  # what waits for it
        self._early_newest = dict[int, Number]()  # by view: of what waits, all of whose parts came
        self.framelet = Framelet.blank(step.rect, step.channels, encoded=step.encoded, order=step.order)
        self._changed: Regions = []
        self._waiting: dict[int, FrameletPart] = {}  # of what belongs together, until all is there

    def begin_with(self, shown: Framelet) -> None:
        """Show a framelet of the same pixels until parts come, as far as it has the channels."""
        if shown.encoded == self.framelet.encoded:
            for name in shown.channels & self.framelet.channels:
                self.framelet.channel(name)[...] = shown.channel(name)

    def insert(self, part: FrameletPart, now: float = -math.inf) -> None:
        """Show a part that came at `now` when all that belong to it are there.

        Raises RemoteProtocolError where it is not of this node.
        """
        part.check(self.framelet)
        if self._period_s:
            part = part.unpacked()
        first = next(iter(self._waiting.values()), part)
        if part.index in self._waiting or (first.refreshed_at, first.count) != (part.refreshed_at, part.count):
            self._admit(now)  # one of them gave way, and its pixels come later
        self._waiting[part.index] = part
        if len(self._waiting) == part.count:
            if part.event is not None:
                view = part.event.view
                self._early_newest[view] = max(self._early_newest.get(view, NEVER), part.event.number)
            self._admit(now)

    def _admit(self, now: float) -> None:
        """What came is shown when it is due, with what waits for that already."""
        self._early += self._waiting.values()
        self._waiting = {}
        if now < self.even_from:
            self.due = now
        elif self.due == math.inf:
            self.due = max(now, min(self._shown_at + APART * self._period_s, now + HELD * self._period_s))
        if not self._period_s:
            self.show(now)

    def newest_event(self, view: int = 0) -> Number:
        """The newest event of a view that has a sample in it."""
        return self._newest.get(view, NEVER)

    def show(self, now: float, *, force: bool = False) -> None:
        """Show what waits if it is due, or `force`."""
        if not self._early or (now < self.due and not force):
            return
        out = self.framelet
        for part in self._early:
            part.write(out)
            out.stamp(part.refreshed_at, except_for=part.rect)
            out.event = part.event
            self._changed.append(part.rect)
        self._newest |= self._early_newest
        self._early, self.due, self._shown_at = [], math.inf, now

    @property
    def changed(self) -> bool:
        """Whether anything came since the changes were taken."""
        return bool(self._changed)

    def take_changes(self) -> Regions:
        """Returns the regions that changed since the last call, and resets them."""
        changed, self._changed = merged(self._changed), []
        return changed


class Outlets:
    """What other ranks need of this one: pending regions, sent as soon as there is credit, newest content first."""

    def __init__(
        self, graph: Graph, rank: int, ready: Ready, *, compared: bool = False, shares: Shares = shares_nothing
    ) -> None:
        self._graph, self._ready, self._shares, self.compared = graph, ready, shares, compared
        self._targets = targets_of(graph, rank)
        self._pending: dict[tuple[int, int], Regions] = {}  # by step and target
        self._under_way: dict[tuple[int, int], deque[bytes]] = {}  # parts that belong together, not sent yet
        self._due: set[tuple[int, int]] = set()  # whose number must travel though nothing changed

    def add(self, changes: Changes, *, all_due: bool = False) -> None:
        """Note what changed. `all_due`: every target waits for a packet, even one that says that nothing changed."""
        for step, targets in self._targets.items():
            for target in targets:
                if regions := changes.get(step):
                    self._pending.setdefault((step, target), []).extend(regions)
                if all_due:
                    self._due.add((step, target))

    def send(self, framelets: Mapping[int, Framelet], number: Callable[[int], Number]) -> Iterator[Offer]:
        """Offer what is pending where there is credit. `number`: the newest event of a view that has a sample in it."""
        for key in dict.fromkeys((*self._under_way, *self._pending, *self._due)):
            step, target = key
            while self._ready(target):
                if key not in self._under_way:
                    if key not in self._pending and key not in self._due:
                        break
                    self._begin(key, framelets[step], number)
                yield Offer(target, self._under_way[key].popleft())
                if not self._under_way[key]:
                    del self._under_way[key]

    def _begin(self, key: tuple[int, int], framelet: Framelet, newest: Callable[[int], Number]) -> None:
        """Make the parts of what is pending: they show one moment, so all are made now."""
        event = framelet.event
        if event is None and self._graph.sync != "none":
            event = NOWHERE  # a target waits for the frame's number, even of what no camera sees
        number = newest(event.view) if event is not None else NEVER
        told = None if event is None else replace(event, camera_event=number[0], scene_event=number[1])
        regions = merged(self._pending.pop(key, []))
        self._due.discard(key)
        if not regions:
            regions = [Rect(x=framelet.rect.x, y=framelet.rect.y, width=1, height=1)]
        rects = [rect for region in regions for rect in bands(region, framelet.channels, encoded=framelet.encoded)]
        pixels = bytes_a_pixel(framelet.channels, encoded=framelet.encoded) * framelet.rect.area
        plain = self._shares(key[1], HEADER_BYTES + HEAD.size + min(pixels, MAX_RAW))
        parts = [FrameletPart.of(key[0], framelet, rect, compared=self.compared, plain=plain) for rect in rects]
        self._under_way[key] = deque(
            serialise(replace(part, event=told, index=k, count=len(parts))) for k, part in enumerate(parts)
        )

    def lose(self, target: int, part: FrameletPart) -> None:
        """A part did not get there: its pixels are pending again."""
        self._pending.setdefault((part.step, target), []).append(part.rect)

    def renew(self, target: int) -> None:
        """A rank has begun anew: all that it needs is pending."""
        for step, targets in self._targets.items():
            if target in targets:
                self._under_way.pop((step, target), None)
                self._pending[step, target] = [self._graph.steps[step].rect]

    @property
    def idle(self) -> bool:
        """Whether everything has been offered."""
        return not self._pending and not self._due and not self._under_way


class Sent:
    """Counts the packets that a role offers."""

    def __init__(self) -> None:
        self.packets = self.bytes = 0

    def counted(self, offers: Iterable[Offer]) -> Iterator[Offer]:
        """The same offers, each counted as it is taken."""
        for offer in offers:
            self.packets += 1
            self.bytes += len(offer.packet)
            yield offer


def target_ranks(graph: Graph, rank: int) -> set[int]:
    """The other ranks that need any framelet of a rank."""
    return {target for targets in targets_of(graph, rank).values() for target in targets}


def targets_of(graph: Graph, rank: int) -> dict[int, tuple[int, ...]]:
    """By step of a rank: the other ranks that need its framelet."""
    found = {}
    for step in graph.steps:
        others = sorted({graph.steps[user].rank for user in step.users} - {rank})
        if step.rank == rank and others:
            found[step.index] = tuple(others)
    return found


def shows_only(graph: Graph, rank: int) -> bool:
    """Whether a rank shows images that others made, evenly as they come: it makes none, and waits for no frame."""
    return not graph.layers_on(rank) and graph.sync == "none"


def needed_from_others(graph: Graph, rank: int) -> tuple[Step, ...]:
    """Steps of other ranks whose framelets are needed here."""
    found = {k for step in graph.steps if step.rank == rank for k in step.inputs if graph.steps[k].rank != rank}
    return tuple(graph.steps[k] for k in sorted(found))
