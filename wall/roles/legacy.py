"""What a manager leaves to the one that takes its place: all that nobody else in the run knows.

Who is in the run, and how ranks are, ranks tell by themselves. Numbers go on far behind those that were last written
down: ranks may have heard of newer ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from wall.core.data import Edits
from wall.packets.control import EditAnswer, Selection
from wall.packets.notes import note_of
from wall.roles.config_edits import text_of
from wall.roles.director import Kept
from wall.roles.manager import Manager
from wall.roles.plan import HEAD, Plan
from wall.roles.reloading import Reloads
from wall.scene.parameters import Numbers

NUMBERS_AHEAD = 1 << 20  # of events, edits and configurations: more than are made while nothing is written down


@dataclass(frozen=True, slots=True, kw_only=True)
class Legacy:
    """Of a manager at one moment."""

    began: float  # when the run did, seconds of the head's clock
    camera_event: int  # the first that was not used yet
    edits: Edits
    picture: Mapping[str, Numbers]  # exposure and tone mapping, where edited
    count: int  # of edits
    answers: tuple[EditAnswer, ...]  # of the editor, so that no request is done again
    assignment: int  # number of the newest one; then how many were made
    assignments: int
    views: Mapping[str, Kept]  # by name
    selection: Selection
    reloads: Reloads
    number: int  # of the configuration; then
    text: str  # its text, "" of the first one
    path: str
    restarts: Mapping[int, tuple[str, ...]]  # by rank: how those died in whose place another came, the first one first


def legacy_of(manager: Manager, before: Legacy | None = None) -> Legacy:
    """What it leaves if it ends now; `before`: what it left earlier, whose text is not made again."""
    plan, editor, balancer = manager.newest_plan, manager.editor, manager.balancer
    loaded, text = plan.layout.loaded, ""
    if plan.number:
        text = before.text if before is not None and before.number == plan.number else text_of(loaded.config)
    return Legacy(
        began=manager.began,
        camera_event=manager.since,
        edits=editor.edits,
        picture=editor.picture,
        count=editor.count,
        answers=editor.answers,
        assignment=balancer.assignment.number if balancer is not None else 0,
        assignments=balancer.made if balancer is not None else 0,
        views={director.name: director.kept for director in manager.directors},
        selection=replace(manager.commands.selection, names=[]) if manager.reloading.adopting
        else manager.commands.selection,
        reloads=manager.reloading.left(editor.count),
        number=plan.number,
        text=text,
        path=str(loaded.path) if plan.number else "",
        restarts={rank: tuple(how) for rank, how in manager.register.restarts.items()},
    )


def plan_after(plan: Plan, legacy: Legacy) -> Plan:
    """The plan of a run whose events go on."""
    return replace(plan, since=legacy.camera_event + NUMBERS_AHEAD)


def inherit(manager: Manager, legacy: Legacy, how: str) -> None:
    """Let a new manager, of `plan_after`, go on from another one; `how`: it died."""
    manager.began = legacy.began
    manager.editor.inherit(legacy.edits, legacy.picture, legacy.count + NUMBERS_AHEAD, legacy.answers)
    manager.reloading.inherit(legacy.reloads, legacy.reloads.number + NUMBERS_AHEAD)
    manager.commands.selection = legacy.selection
    if manager.balancer is not None:
        manager.balancer.count_from(legacy.assignment + NUMBERS_AHEAD, legacy.assignments)
    for director in manager.directors:
        if (kept := legacy.views.get(director.name)) is not None:
            director.keep(kept)
    manager.register.restarts.update((rank, list(each)) for rank, each in legacy.restarts.items())
    manager.register.restarts.setdefault(HEAD, []).append(how)
    manager.register.news.append(note_of(HEAD, "warning", f"the head {how}, and another one has taken its place"))
