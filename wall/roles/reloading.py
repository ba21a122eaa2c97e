"""Another configuration while the run goes on, as the manager leads it.

asked -> the head makes a plan of it -> every rank makes one beside what runs -> all adopt it, and a new view begins

Until all adopt it, nothing has changed: what any rank refuses is refused. In between no event is published, so that
nothing of the new configuration is sent to a rank that is still at the old one.
"""

from __future__ import annotations

import enum
import math
import re
from collections import deque
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace

from wall.compositing.graph import Step
from wall.config.framed_page import with_page
from wall.config.graph import PresetGraph, SinkNode
from wall.config.loading import Loaded
from wall.core.errors import ConfigError, EditError
from wall.geometry.panels import Panel
from wall.packets.control import Adopt, EditAnswer, EditRequest, Heartbeat, Prepare, Prepared
from wall.roles.config_edits import edited, text_of
from wall.roles.editing import Editor
from wall.roles.instructions import Broadcast, Instruction, Make, PlanMade, Send
from wall.roles.plan import Layout, Plan, window_panels

MOST_UNDONE = 16  # configurations that can be taken back
AGAIN_S = 1.0  # between copies of what is not answered
PREPARE_S = 600.0  # for all ranks to load a model, and to compile for it
ADOPT_S = 5.0  # for all ranks to go over; who comes later finds the events there


_PLACE = re.compile(r":\d+:\d+: ")  # in a text


class Stage(enum.Enum):
    """How far a reload has come."""

    NONE = enum.auto()
    PLANNING = enum.auto()  # the head makes its plan
    PREPARING = enum.auto()  # so do all others
    ADOPTING = enum.auto()  # all go over to it


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A configuration that the run is to adopt, and who waits to hear of it."""

    text: str
    path: str
    client: int = 0  # of an EditRequest, which is answered; 0: of nobody
    request: int = 0  # its number
    written: bool = True  # by somebody, who knows its lines; False: made of the configuration that runs, or before
    back: bool = False  # to the configuration before

    def answer(self, refused: str = "", *, edit: int = 0) -> Iterator[Send]:
        """What who asked is told: why not, or that it is done, as of the newest edit."""
        if self.client:
            answer = EditAnswer(client=self.client, number=self.request, refused=refused, edit=edit)
            yield Send(self.client, answer)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reloads:
    """What a manager leaves to the next one of the configurations that it was asked for."""

    number: int  # of the newest one, adopted or not
    client: int  # of the newest request; then its number
    request: int
    answers: tuple[Send, ...]  # to it; (): it was not done


class Reloading:
    """One reload at a time: `ask` for it, hear of plans and ranks, `on_tick` leads it through its stages."""

    def __init__(self, plan: Plan, *, fixed: str = "") -> None:
        """`fixed`: why this run keeps its configuration; "" if it need not."""
        self._plan, self._fixed = plan, fixed
        self._stage, self._asked = Stage.NONE, Asked(text="", path="")
        self._number = 0  # of the newest that was asked for
        self._made: Plan | None = None  # of it
        self._missing: set[int] = set()  # ranks that have not prepared or adopted it
        self._limit = self._again = math.inf
        self.said = ""  # what came of the last one, in words
        self._former = deque[Loaded](maxlen=MOST_UNDONE)  # what ran before, the newest last
        self._answered: list[Send] = []  # what who asked last was told
        self._saved: Asked | None = None  # the newest text of the run's file, saved while another was under way

    @property
    def adopting(self) -> bool:
        """Whether ranks go over to a configuration just now: no event is to be published."""
        return self._stage is Stage.ADOPTING

    @property
    def busy(self) -> bool:
        """Whether another configuration is under way."""
        return self._stage is not Stage.NONE

    def left(self, edit: int) -> Reloads:
        """What the next manager has to know; `edit`: number of the newest edit.

        What ranks go over to is adopted by then.
        """
        answers = self._asked.answer(edit=edit) if self.adopting else self._answered
        return Reloads(
            number=self._number, client=self._asked.client, request=self._asked.request, answers=tuple(answers)
        )

    def inherit(self, left: Reloads, number: int) -> None:
        """Go on from another one's reloads; `number`: beyond all that ranks may have heard of."""
        self._number = number
        if left.answers:  # the same request is answered again; another one is tried again
            self._asked = Asked(text="", path="", client=left.client, request=left.request)
            self._answered = list(left.answers)

    @property
    def coming(self) -> Plan | None:
        """The plan that ranks go over to just now; None while they do not."""
        return self._made if self.adopting else None

    def grow(self, plan: Plan) -> None:
        """The run has more ranks than before."""
        self._plan = plan

    def ask(self, asked: Asked, now: float) -> Iterator[Instruction]:
        """Begin. Raises EditError where that cannot be."""
        if self._stage is not Stage.NONE:
            if _same_request(asked, self._asked):
                return  # said again: it is under way
            raise EditError("another configuration is being loaded; wanted: one after the other")
        if self._fixed:
            raise EditError(f"this run keeps its configuration: {self._fixed}")
        self._asked, self._answered = asked, []
        self._stage, self._limit = Stage.PLANNING, now + PREPARE_S
        self._number += 1
        yield Make(self._message())

    def save(self, asked: Asked, now: float) -> Iterator[Instruction]:
        """The run's file has another text: load it, after what is under way. Raises EditError."""
        if self.busy:
            self._saved = asked
        else:
            yield from self.ask(asked, now)

    def takes(self, request: EditRequest, editor: Editor) -> bool:
        """Whether a request wants another configuration; to undo does where no parameter was edited since the last."""
        undoes = request.undo > 0 and self.can_undo and not editor.can_undo and not editor.has_answered(request)
        again = _same_request(asked_by(request, ""), self._asked)
        return bool(request.configuration or request.changes or undoes or again)

    def load(self, request: EditRequest, editor: Editor, now: float) -> Iterator[Instruction]:
        """Begin to load, change or take back a configuration for who knows the key.

        The answer comes when that is done, or refused.
        """
        asked = asked_by(request, str(self._plan.layout.loaded.path))
        try:
            editor.check_key(request)
            _check_alone(request)
            if _same_request(asked, self._asked):
                yield from self._answered
            elif request.configuration:
                yield from self.ask(asked, now)
            elif request.changes:
                text = edited(self._plan.layout.loaded.config, request.changes)
                yield from self.ask(replace(asked, text=text, written=False), now)
            else:
                yield from self.undo(now, asked)
        except EditError as error:
            editor.counters["refused_edit"] += 1
            yield from asked.answer(str(error))

    @property
    def can_undo(self) -> bool:
        """Whether another configuration ran before this one."""
        return bool(self._former)

    def undo(self, now: float, asked: Asked | None = None) -> Iterator[Instruction]:
        """Go back to the configuration before. `asked`: by whom; None: by nobody who waits. Raises EditError."""
        former, asked = self._former[-1], asked or Asked(text="", path="")
        asked = replace(asked, text=text_of(former.config), path=str(former.path), written=False, back=True)
        yield from self.ask(asked, now)

    def _message(self) -> Prepare:
        return Prepare(number=self._number, text=self._asked.text, path=self._asked.path)

    def made(self, made: PlanMade, now: float) -> Iterator[Instruction]:
        """The head has made a plan, or cannot."""
        if self._stage is not Stage.PLANNING or made.number != self._number:
            return
        if made.plan is None:
            yield from self._refuse(made.refused)
            return
        self._made, self._stage, self._again = made.plan, Stage.PREPARING, now
        self._missing = set(range(self._plan.layout.size))

    def forget(self, rank: int) -> None:
        """A rank has died and is started again: what it had prepared is gone."""
        if self._stage is Stage.PREPARING:
            self._missing.add(rank)

    def prepared(self, message: Prepared) -> Iterator[Instruction]:
        """A rank has prepared, or cannot."""
        if self._stage is Stage.PREPARING and message.number == self._number:
            self._missing.discard(message.rank)
            if message.refused:
                yield from self._refuse(f"rank {message.rank}: {message.refused}")

    def on_tick(self, now: float, since: int, lost: Container[int]) -> Iterator[Instruction]:
        """Say again what is not answered; let all adopt what all have prepared. `since`: see Adopt."""
        if self._saved is not None and not self.busy:
            saved, self._saved = self._saved, None
            yield from self.ask(saved, now)
        if self._stage in (Stage.PLANNING, Stage.PREPARING) and now >= self._limit:
            who = "the head" if self._stage is Stage.PLANNING else f"rank {min(self._missing)}"
            yield from self._refuse(f"{who} has not prepared it within {PREPARE_S:g} s")
        if self._stage is Stage.PREPARING:
            self._missing = {rank for rank in self._missing if rank not in lost}
            if self._missing and now >= self._again:
                self._again = now + AGAIN_S
                yield Broadcast(self._message())
            elif not self._missing:
                self._stage, self._limit, self._again = Stage.ADOPTING, now + ADOPT_S, now
                self._missing = set(range(self._plan.layout.size))
        if self._stage is Stage.ADOPTING and now >= self._again:
            self._again = now + AGAIN_S
            yield Broadcast(Adopt(number=self._number, since=since))

    def adopted(self, heartbeats: Mapping[int, Heartbeat], now: float, lost: Container[int]) -> Plan | None:
        """The plan that every living rank has adopted by now; None where none is, or was before."""
        if self._stage is not Stage.ADOPTING:
            return None
        self._missing = {
            rank
            for rank in self._missing
            if rank not in lost and (rank not in heartbeats or heartbeats[rank].configuration != self._number)
        }
        if self._missing and now < self._limit:
            return None
        assert self._made is not None
        if self._asked.back:
            self._former.pop()
        else:
            self._former.append(self._plan.layout.loaded)
        self._plan, self._stage = self._made, Stage.NONE
        return self._plan

    def answer(self, edit: int) -> Iterator[Instruction]:
        """Tell who asked that it is done; `edit`: number of the newest edit."""
        source = self._plan.layout.loaded.config.scene.source
        shown = source if isinstance(source, str) else ", ".join(source or ("data",))
        self.said = f"{self._asked.path}: adopted{' again' if self._asked.back else ''}, scene: {shown}"
        yield from self._tell(edit=edit)

    def _refuse(self, why: str) -> Iterator[Instruction]:
        why = why if self._asked.written else _PLACE.sub(": ", why)
        self._stage, self.said = Stage.NONE, f"refused, nothing has changed: {why}"
        yield from self._tell(why)

    def _tell(self, refused: str = "", *, edit: int = 0) -> Iterator[Instruction]:
        """Answer who asked, and be ready to answer again."""
        self._answered = list(self._asked.answer(refused, edit=edit))
        yield from self._answered


def asked_by(request: EditRequest, path: str) -> Asked:
    """What a request wants; `path`: of the run's own configuration."""
    return Asked(text=request.configuration, path=request.path or path, client=request.client, request=request.number)


def _check_alone(request: EditRequest) -> None:
    """Refuse a request for a configuration that wants more. Raises EditError."""
    wanted = ("configuration", "changes", "undo", "assignments", "commands")
    named = [name for name in wanted if getattr(request, name)]
    if len(named) > 1:
        raise EditError(f"{' and '.join(named)} at once: want one of them")


def _same_request(one: Asked, other: Asked) -> bool:
    """Whether one comes again."""
    return (one.client, one.request) == (other.client, other.request) != (0, 0)


def as_run(old: Layout, loaded: Loaded) -> Loaded:
    """A configuration as a run of `old` takes it: its page may be framed if that of the run may.

    A script that runs a wall wants that, whatever its files say, and a page where a preset graph has none.
    """
    if not old.config.output.browser.embed:
        return loaded
    graph = old.config.graph
    return with_page(loaded, sink=isinstance(graph, PresetGraph) and "browser" in graph.sinks)


def check_fits(old: Layout, new: Layout) -> None:
    """Refuse what processes and displays that are there already cannot become. Raises ConfigError."""
    loaded = new.loaded
    own = len(old.regions) - old.extra  # renderers that have joined are no matter of the configuration
    if (old.graph.compositors, own) != (new.graph.compositors, len(new.regions)):
        c, r = new.graph.compositors, len(new.regions)
        wants = f"{c} compositor{'s' * (c > 1)} and {r} renderer{'s' * (r > 1)}"
        raise ConfigError(
            f"{loaded.name}: wants {wants}; this run has {old.graph.compositors} and {own}, and keeps them"
        )
    for name in ("transport", "output"):
        if getattr(old.config, name) != getattr(new.config, name):
            raise loaded.error((name,), "differs from that of the run, which keeps it", "the same, or a new run")
    screens = [[(panel.id, panel.pixels, panel.span) for panel in each.wall.panels] for each in (old, new)]
    if screens[0] != screens[1]:
        raise loaded.error(("wall",), "has other panels or pixels than the displays of this run", "the same panels")
    for rank in range(old.graph.compositors):
        sinks = [sorted(_sink(step) for step in each.graph.sinks_on(rank)) for each in (old, new)]
        windows = [[_window(panel) for panel in window_panels(each, (rank,))] for each in (old, new)]
        if sinks[0] != sinks[1] or windows[0] != windows[1]:
            raise loaded.error(("graph",), f"rank {rank} has other sinks or windows than in this run", "the same")
    if old.extra and new.strips is None:
        why = "renderers have joined, which have something to do only while borders move"
        raise loaded.error(("graph",), why, "balance: true, or that they leave first")
    if old.graph.hosts != new.graph.hosts:
        raise loaded.error(("wall",), "wants other hosts than this run", "the same hosts")


def _sink(step: Step) -> tuple[str, str, tuple[int, ...]]:
    node = step.node
    return node.id, node.kind if isinstance(node, SinkNode) else "", step.panels


def _window(panel: Panel) -> tuple[object, ...]:
    config = panel.config
    return config.display, config.monitor, config.window, config.rotation, config.refresh_hz
