"""Processes that become ranks of a running wall: the manager gives them the places of lost renderers, or new ones.

asked -> the process makes the run's configuration -> asked again -> a place is given away -> it says Hello

A place is given to one process, by its own key, and from then on to no restart. New places, beyond the configuration's,
there are where borders between renderers move: cuts give them something to do.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from wall.core.errors import EditError, RemoteProtocolError
from wall.packets.control import Hello
from wall.packets.joining import JoinAnswer, JoinRequest
from wall.roles.editing import Editor
from wall.roles.instructions import Admit, Broadcast, Instruction, Invitation, Send
from wall.roles.membership import Register
from wall.roles.plan import Layout, Plan

HELLO_S = 10.0  # for a process that has a place to say Hello; then the place is free again


@dataclass(frozen=True, slots=True)
class Given:
    """To whom a place was given."""

    client: int
    key: str
    limit: float  # until when it may be on its way


class Joining:
    """Who has which place, and who gets one."""

    def __init__(self, fixed: str = "") -> None:
        """`fixed`: why nobody may join, "" if processes may."""
        self.invitation: Invitation | None = None
        self.extra = 0  # places beyond the configuration's
        self._fixed = fixed
        self._given: dict[int, Given] = {}  # by rank: the newest

    @property
    def ranks(self) -> frozenset[int]:
        """Places that were given away: what was there before is not to be started again. Other threads may ask."""
        return frozenset(self._given)

    def check(self, hello: Hello) -> None:
        """Refuse a Hello of a process whose place another one has. Raises RemoteProtocolError."""
        given = self._given.get(hello.rank)
        if hello.key != (given.key if given is not None else ""):
            raise RemoteProtocolError(f"rank {hello.rank} is another process by now")

    def answer(
        self, request: JoinRequest, editor: Editor, plan: Plan, register: Register, *, busy: bool, now: float
    ) -> Iterator[Instruction]:
        """Give a process a place, or tell it what it needs for one, or why there is none.

        `busy`: another configuration is under way. No answer as long as nobody knows what the configuration takes: it
        is asked for again.
        """
        try:
            editor.check_key(request)
            free = self._free(request, plan.layout, register, now)
            if busy:
                raise EditError("another configuration is being loaded; wanted: to join when that is done")
            if self._fixed:
                raise EditError(f"nobody can join this run: {self._fixed}")
            if free is None:
                raise EditError(_why_none(plan.layout))
        except EditError as error:
            editor.counters["refused_join"] += 1
            yield Send(request.client, JoinAnswer(client=request.client, number=request.number, refused=str(error)))
            return
        if self.invitation is None or self.invitation.number != plan.number:
            return
        answer = JoinAnswer(
            client=request.client, number=request.number, configuration=plan.number, since=plan.since, extra=self.extra
        )
        if request.configuration != plan.number:
            yield Send(request.client, replace(answer, told=self.invitation.told))
            return
        self._given[free] = Given(request.client, request.public, now + HELLO_S)
        self.extra += free >= plan.layout.size
        register.give_away(free)
        yield Admit(free, request.public)
        yield Broadcast(Hello(rank=free, host=request.host, endpoint="", incarnation=0, key=request.public))
        yield Send(request.client, replace(answer, rank=free, extra=self.extra))

    def _free(self, request: JoinRequest, layout: Layout, register: Register, now: float) -> int | None:
        """A place for who asks: the one that it has got, or of the lost, the dead first, or a new one."""
        for rank, given in self._given.items():
            if given.client == request.client:
                return rank
        taken = {rank for rank, given in self._given.items() if now < given.limit and register.promised(rank)}
        lost = [rank for rank in layout.renderers() if register.excused(rank) and rank not in taken]
        if lost:
            return min(lost, key=lambda rank: (not register.died(rank), rank))
        if layout.strips is None or len(layout.regions) >= layout.strips.most_ranks:
            return None
        return layout.size


def _why_none(layout: Layout) -> str:
    """Why there is no place."""
    count = len(layout.regions)
    there = f"no renderer is missing: {count} of {count} are there or on their way"
    if layout.strips is not None:
        return f"{there}, and the wall has no rows for another one"
    return f"{there}; wanted: one that is lost, or graph: {{balance: true}}, under which more may come"


def grown(layout: Layout, extra: int) -> Layout:
    """The same layout with so many renderers beyond the configuration's, which have no region yet."""
    more = extra - layout.extra
    return replace(layout, regions=(*layout.regions, *[()] * more), extra=extra) if more > 0 else layout
