"""The one owner of edits: takes values by name, refuses what the scene does not accept, numbers the rest.

An edit is a name path and a value. All edits of one request hold, or none. Later kinds of edits are further parameters,
or further prefixes of name paths.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import math
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from fnmatch import fnmatchcase
from typing import Any, TypeAlias

from wall.config.sampling import LARGEST_STAGE, ProgressiveSampling
from wall.core.data import MOST_SAMPLES, NO_EDITS, Edits, Event
from wall.core.errors import EditError
from wall.core.tone_mapping import Tone
from wall.display.base import ParameterState
from wall.geometry.steering import Command
from wall.packets.control import ALL_BUT_OBJECTS, MAX_ANSWER_BYTES, EditAnswer, EditRequest
from wall.packets.edits import MAX_NAME_BYTES, fits
from wall.packets.joining import JoinRequest
from wall.roles.clicks import Clicks
from wall.roles.node_settings import all_parameters, one_gesture
from wall.roles.plan import Plan
from wall.roles.tone import tone_at
from wall.scene.object_edits import EDITS, OBJECTS
from wall.scene.parameters import EXPOSURE, FOCUS, OF_THE_PICTURE, TONE_MAPPING, Numbers, Parameter, named

Values: TypeAlias = tuple[tuple[str, tuple[float, ...]], ...]  # as in Edits

Steer: TypeAlias = Callable[[Sequence[object], "Editor"], None]

MOST_UNDONE = 256  # edits that can be taken back
ONE_EDIT_S = 0.7  # edits of the same parameters that follow each other sooner are undone together
MOST_CLIENTS = 64  # whose newest answer is remembered
ROWS_BYTES = MAX_ANSWER_BYTES - 16384  # of the parameters that an answer lists


class Editor:
    """The state of all edits of a run: `edits` of the scene, `picture`: exposure and tone mapping of it alone."""

    def __init__(self, plan: Plan, *, key: str = "") -> None:
        """`key`: what requests of other processes have to bring; "" refuses all of them."""
        self._plan, self._key = plan, key
        self.parameters = editable(plan)
        self.edits = NO_EDITS
        self.picture: dict[str, Numbers] = {}  # what is not as configured
        self.counters = Counter[str]()
        self.clicks = Clicks(plan)
        self._count = 0  # edits so far, of the scene or not
        self._undoable = deque[tuple[Values, dict[str, Numbers]]](maxlen=MOST_UNDONE)  # states before edits
        self._newest: tuple[frozenset[str], float] = (frozenset(), -math.inf)  # which parameters, when
        self._answered = dict[int, EditAnswer]()  # the newest of each client

    def adopt(self, plan: Plan) -> None:
        """Edit another configuration's scene: edits that it accepts stay, and cannot be undone any more."""
        self._plan, self.parameters, self.clicks = plan, editable(plan), Clicks(plan)
        self._undoable.clear()
        kept = {}
        for name, value in self.edits.values:
            with contextlib.suppress(EditError):
                kept[name] = named(self.parameters, name).checked(value)
        self._count += 1
        self.edits = Edits(self._count, tuple(sorted(kept.items()))) if kept else NO_EDITS

    def inherit(
        self, edits: Edits, picture: Mapping[str, Numbers], count: int, answers: Sequence[EditAnswer] = ()
    ) -> None:
        """Go on from another editor's edits, which cannot be undone any more. `count`: a new number.

        `answers`: its `answers`.
        """
        self._count, self.picture = count, dict(picture)
        self._answered = {answer.client: answer for answer in answers}
        self.edits = Edits(count, edits.values) if edits.values else NO_EDITS

    def check_key(self, request: EditRequest | JoinRequest) -> None:
        """Refuse who does not know the run's key. Raises EditError."""
        if not self._key or not hmac.compare_digest(request.key.encode(), self._key.encode()):
            self.counters["edit_without_key"] += 1
            raise EditError("the key is not this run's")

    @property
    def count(self) -> int:
        """Number of the newest edit."""
        return self._count

    @property
    def answers(self) -> tuple[EditAnswer, ...]:
        """The newest to each client, without the parameters that it listed."""
        return tuple(replace(answer, parameters=[], left_out=0) for answer in self._answered.values())

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit of a parameter to undo."""
        return bool(self._undoable)

    def has_answered(self, request: EditRequest) -> bool:
        """Whether a request comes again."""
        known = self._answered.get(request.client)
        return known is not None and known.number == request.number

    def set(self, assignments: Sequence[tuple[str, object]], now: float = 0.0) -> None:
        """Set parameters to values, all or none; None sets the configuration's. Raises EditError.

        `now`: seconds; what follows at once on the same parameters is undone with it.
        """
        values, picture, scene_changes = dict(self.edits.values), dict(self.picture), False
        for name, value in assignments:
            parameter = named(self.parameters, name)
            numbers = None if value is None else parameter.checked(value)
            changed = picture if name in OF_THE_PICTURE else values
            before = changed.pop(name, None)
            if numbers is not None:
                changed[name] = numbers
            scene_changes |= changed is values and numbers != before
        new = self.edits
        if scene_changes:
            new = Edits(self._count + 1, tuple(sorted(values.items())))
            if not fits(new):
                raise EditError(f"{len(values)} parameters are changed already: no event has room for more")
        if scene_changes or picture != self.picture:
            names, (last_names, last) = frozenset(one_gesture(name) for name, _ in assignments), self._newest
            if names != last_names or now - last > ONE_EDIT_S:
                self._undoable.append((self.edits.values, self.picture))
            self._newest = names, now
            self._count += 1
        self.edits, self.picture = new, picture

    def apply(self, command: Command, events: Sequence[Event], now: float) -> bool:
        """Do what a viewer's command edits, `events` being shown. Returns whether it edits. Raises EditError."""
        if command.kind == "set":
            self.set([(command.value, command.numbers)], now)
        elif command.kind == "expose":
            self.expose(command.x, events[0].scene_time, now)
        elif command.kind == "undo":
            self.undo()
        elif command.kind == "focus":
            self.focus(events, command.x, command.y)
        else:
            return False
        return True

    def undo(self, steps: int = 1) -> None:
        """Take back so many edits, or what is left of them. Raises EditError where there is none."""
        if not self._undoable:
            raise EditError("there is no edit to undo")
        for _ in range(min(steps, len(self._undoable))):
            values, self.picture = self._undoable.pop()
        self._count += 1
        self._newest = (frozenset(), -math.inf)
        if values != self.edits.values:
            self.edits = Edits(self._count, values)

    def tone(self, scene_time: float) -> Tone:
        """How the picture is shown at a scene time in seconds."""
        return tone_at(self._plan, scene_time, self.picture)

    def expose(self, more: float, scene_time: float, now: float = 0.0) -> None:
        """Add stops to the exposure, within its range; `now` as in `set`."""
        range_of = self.parameters[EXPOSURE]
        stops = round(self.tone(scene_time).stops + more, 6)
        self.set([(EXPOSURE, min(max(stops, range_of.low), range_of.high))], now)

    def focus(self, events: Sequence[Event], x: float, y: float) -> None:
        """Focus at what is shown at a place of the wall, see Clicks.distance; the sky is as far as can be."""
        range_of = named(self.parameters, FOCUS)
        self.set([(FOCUS, min(max(self.clicks.distance(events, x, y), range_of.low), range_of.high))])

    def answer(
        self, request: EditRequest, scene_time: float, now: float = 0.0, steer: Steer | None = None
    ) -> EditAnswer:
        """Do what another process asks for, once: a request that comes again gets the same answer.

        `steer`: does its commands, or raises EditError.
        """
        if self.has_answered(request):
            known = self._answered[request.client]
            return known if known.parameters or not request.listed else self._listing(known, request, scene_time)
        answer = self._answer(request, scene_time, now, steer)
        self._answered.pop(request.client, None)
        self._answered[request.client] = answer
        if len(self._answered) > MOST_CLIENTS:
            del self._answered[next(iter(self._answered))]
        return answer

    def _answer(self, request: EditRequest, scene_time: float, now: float, steer: Steer | None) -> EditAnswer:
        try:
            self.check_key(request)
            if (request.undo > 0) + bool(request.assignments) + bool(request.commands) > 1:
                raise EditError("to undo, to set or to steer at once: want one of them")
            if request.undo > 0:
                self.undo(request.undo)
            if request.commands and steer is not None:
                steer(request.commands, self)
            self.set([_assignment(each) for each in request.assignments], now)
            refused = ""
        except EditError as error:
            self.counters["refused_edit"] += 1
            refused = str(error)
        answer = EditAnswer(client=request.client, number=request.number, refused=refused, edit=self._count)
        return self._listing(answer, request, scene_time)

    def _listing(self, answer: EditAnswer, request: EditRequest, scene_time: float) -> EditAnswer:
        """An answer with the parameters that are to be listed, unless it refuses."""
        wanted = {} if answer.refused or not request.listed else _named_like(request.listed, self.parameters)
        rows = _with_room([asdict(state) for state in self.states(scene_time, wanted)])
        return replace(answer, parameters=rows, left_out=len(wanted) - len(rows))

    def states(self, scene_time: float, wanted: Mapping[str, Parameter] | None = None) -> tuple[ParameterState, ...]:
        """Parameters as they are at a scene time in seconds; `wanted`: None: all."""
        parameters = self.parameters if wanted is None else wanted
        return states_of(self._plan, parameters, scene_time, self.edits, self.tone(scene_time))


def editable(plan: Plan) -> dict[str, Parameter]:
    """The parameters of a plan whose names fit a message."""
    found = all_parameters(plan.scenes, plan.layout.graph, plan.layout.config)
    samplings = map(plan.layout.sampling_of, range(len(plan.views)))
    if progressive := [each for each in samplings if isinstance(each, ProgressiveSampling)]:
        most = (float(progressive[0].samples_per_pixel),)
        found[MOST_SAMPLES] = Parameter(
            name=MOST_SAMPLES, kind="whole", low=1, high=LARGEST_STAGE, unit="samples", default=most
        )
    return {name: parameter for name, parameter in found.items() if len(name.encode()) <= MAX_NAME_BYTES}


def shown_parameters(plan: Plan, selected: Sequence[str] = ()) -> dict[str, Parameter]:
    """Those that pages show: of objects, of which there may be thousands, the `selected` ones' alone, and first."""
    found = editable(plan)
    own = (f"{OBJECTS}{name}.{what}" for name in dict.fromkeys(selected) for what in EDITS)
    others = {name: parameter for name, parameter in found.items() if not name.startswith(OBJECTS)}
    return {name: found[name] for name in own if name in found} | others


def states_of(
    plan: Plan, parameters: Mapping[str, Parameter], scene_time: float, edits: Edits, tone: Tone
) -> tuple[ParameterState, ...]:
    """Every parameter as it is under some edits at a scene time in seconds, and the picture shown as `tone` says."""
    values = plan.scene.values(scene_time, edits) | {EXPOSURE: (tone.stops,), TONE_MAPPING: (float(tone.code),)}
    return tuple(
        ParameterState(
            name=p.name, kind=p.kind, low=p.low, high=p.high, unit=p.unit, default=p.default,
            value=values.get(p.name, p.default), choices=p.choices,
        )
        for p in parameters.values()
    )  # fmt: skip


def _named_like(patterns: Sequence[Any], parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Those whose names match one of some patterns, see EditRequest; what is no text matches none."""
    texts = [pattern for pattern in patterns if isinstance(pattern, str)]
    others = ALL_BUT_OBJECTS in texts
    return {
        name: parameter
        for name, parameter in parameters.items()
        if (others and not name.startswith(OBJECTS)) or any(name == text or fnmatchcase(name, text) for text in texts)
    }


def _with_room(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The first of some rows, as many as an answer has room for."""
    room = ROWS_BYTES
    for k, row in enumerate(rows):
        room -= len(json.dumps(row)) + len(", ")
        if room < 0:
            return rows[:k]
    return rows


def _assignment(each: Any) -> tuple[str, object]:
    """A name and a value as they came. Raises EditError where they are not."""
    if not isinstance(each, list) or len(each) != 2 or not isinstance(each[0], str):
        raise EditError(f"{str(each)[:60]}: want a name and a value")
    return each[0], each[1]
