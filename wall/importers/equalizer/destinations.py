"""Find the panels of a config: each view on a segment, or the channel of a root compound, becomes one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.importers.equalizer.canvases import SegmentView, targets, unknown_channel
from wall.importers.equalizer.compounds import ALL_EYES, Compound
from wall.importers.equalizer.frusta import WHOLE, Frustum, View, frustum_of, within
from wall.importers.equalizer.grammar import Statement
from wall.importers.equalizer.resources import Channel, Resources, unique

UNSHOWN = "no panel shows this view on this segment"
SWITCHED = "layouts are not switched as it runs, and no canvas begins with this one"


@dataclass(slots=True, eq=False)
class Destination:
    """A panel of the source: its channel, its corners if the file gives them, and the compounds that render it."""

    id: str
    channel: Channel
    statement: Statement
    part: View  # of the channel
    corners: Float64 | None  # (3, 3) metres; None: the file says nothing
    eyes: frozenset[str]  # CYCLOP, or LEFT and RIGHT
    observer: Statement | None
    view: Statement | None = None  # on a layout
    roots: list[Compound] = field(default_factory=list)

    @property
    def pixels(self) -> tuple[int, int]:
        """Width and height of its part of the channel, with the edges rounded."""
        x, y, w, h = self.part
        size = self.channel.pixels
        return (
            max(1, round((x + w) * size[0]) - round(x * size[0])),
            max(1, round((y + h) * size[1]) - round(y * size[1])),
        )


class Destinations:
    """Collects the panels of a config from its canvases and compounds."""

    def __init__(self, config: Statement, resources: Resources, shown: list[SegmentView], name: str) -> None:
        self._config, self._resources, self._name = config, resources, name
        self._ids: set[str] = set()
        self._of_view = {(id(one.segment), id(one.view)): self._of_segment_view(one) for one in shown}
        self._on_canvas = list(self._of_view.values())
        self._of_channel: dict[tuple[Channel, bytes], Destination] = {}
        self.all: list[Destination] = list(self._on_canvas)
        self._errors: list[ConfigError] = []  # of compounds that name unknown channels or segments

    def read(self) -> list[Destination]:
        """The panels, in the order of the file; a file without canvases and compounds shows each channel.

        Raises ConfigError if no compound can be converted.
        """
        for block in self._config.all("compound"):
            if (whole := self._compound(block, None)) is not None:
                self._root(whole)
        if self._errors and not any(one.roots for one in self.all):
            raise self._errors[0]
        self._drop_cleared()
        for one in self.all:
            one.eyes = _shown_eyes(one)
        if not self.all:
            for channel in self._resources.channels:
                made = self._made(channel.id, channel, channel.statement, WHOLE, None, frozenset({"CYCLOP"}))
                self.all.append(made)
        for one in self.all:
            one.statement.carry(f"panel {one.id}")
            if one.statement.parent is not None and one.statement.parent.word == "canvas":
                one.statement.parent.carry()
            one.channel.statement.carry(f"panel {one.id}")
        return self.all

    def _of_segment_view(self, one: SegmentView) -> Destination:
        """The panel of a view on a segment."""
        made = self._made(one.channel.id, one.channel, one.segment, one.part, one.corners, one.eyes)
        made.observer = one.observer
        made.view = one.view
        if one.view is not None:
            one.view.carry(f"panel {made.id}")
        return made

    def _made(
        self, label: str, channel: Channel, statement: Statement, part: View, corners: Float64 | None,
        eyes: frozenset[str],
    ) -> Destination:  # fmt: skip
        return Destination(unique(label, self._ids), channel, statement, part, corners, eyes, None)

    def _compound(self, block: Statement, parent: Compound | None) -> Compound | None:
        """A compound with all below it; None, and reported as not carried, where it names what is not there."""
        made = Compound(statement=block, parent=parent)
        try:
            self._find_target(made)
        except ConfigError as error:
            self._errors.append(error)
            for one in block.walk():
                one.drop(str(error).removeprefix(f"{self._name}:"))
            return None
        children = [self._compound(child, made) for child in block.all("compound")]
        made.children = [child for child in children if child is not None]
        made.share_ranges()
        return made

    def _find_target(self, made: Compound) -> None:
        """Find the channel, or the segment and view, that it names. Raises ConfigError if there is none."""
        key = made.statement.last("channel")
        if key is not None and key.body is not None:
            key.carry()
            segment, view = targets(self._config, key, self._name)
            made.target = self._of_view.get((id(segment), id(view)), view)
        elif key is not None:
            key.carry()
            made.channel = self._resources.named(str(key.values[0]))
            if made.channel is None:
                raise unknown_channel(key, self._resources, self._name)

    def _root(self, compound: Compound) -> None:
        """Assign the topmost compounds with a channel to panels."""
        if not compound.names_channel:
            if compound.children:
                compound.statement.carry("its children are panels")
            for child in compound.children:
                self._root(child)
        elif isinstance(compound.target, Destination):
            compound.target.roots.append(compound)
            own = _frustum(compound, self._name)
            if own is not None:
                compound.target.corners = own[0].part(compound.target.part)
        elif compound.target is not None:
            view = compound.target
            begun = isinstance(view, Statement) and view.parent is not None and view.parent.carried
            for one in compound.statement.walk():
                one.drop(UNSHOWN if begun else SWITCHED)
        else:
            self._of_compound(compound)

    def _of_compound(self, compound: Compound) -> None:
        """Assign a compound that names its channel: to a new panel, or to one of the same channel and corners."""
        channel = compound.channel
        assert channel is not None
        own = _frustum(compound, self._name)
        corners = own[0].part(own[1]) if own is not None else None
        for one in self._on_canvas:
            if one.channel is channel:
                one.roots.append(compound)
                return
        key = (channel, b"" if corners is None else corners.tobytes())
        if key not in self._of_channel:
            made = self._made(channel.id, channel, compound.statement, WHOLE, corners, frozenset())
            self._of_channel[key] = made
            self.all.append(made)
        made = self._of_channel[key]
        made.roots.append(compound)
        made.eyes |= _eyes(compound)

    def _drop_cleared(self) -> None:
        """Drop panels whose compounds draw nothing, unless none would be left."""
        empty = [one for one in self.all if one.roots and not any(root.draws for root in one.roots)]
        empty = [one for one in empty if not any(_takes(root) for root in one.roots)]
        self._drop(empty, "its compounds only clear it: nothing is shown there")
        hidden = [one for one in self.all if one.channel.off_screen and any(_gives(root) for root in one.roots)]
        self._drop(hidden, "off-screen: panels that take its frames render what they show themselves")

    def _drop(self, some: list[Destination], why: str) -> None:
        """Drop some of the panels, unless none would be left."""
        if len(some) == len(self.all):
            return
        for one in some:
            self.all.remove(one)
            for block in (one.statement, *(root.statement for root in one.roots)):
                block.drop(why)


def _takes(compound: Compound) -> bool:
    """Whether it or a compound below it has an input frame."""
    return any(one.statement.all("inputframe") for one in compound.below())


def _gives(compound: Compound) -> bool:
    """Whether it has an output frame."""
    return bool(compound.statement.all("outputframe"))


def _above(compound: Compound) -> Iterator[Compound]:
    """The compound and all above it, upwards."""
    here: Compound | None = compound
    while here is not None:
        yield here
        here = here.parent


def _frustum(compound: Compound, name: str) -> tuple[Frustum, View] | None:
    """The nearest frustum at or above a compound, with the compound's part of it; else the first one below it."""
    view = WHOLE
    for here in _above(compound):
        view = within(here.view, view)
        if (found := frustum_of(here.statement, name)) is not None:
            return found, view
    for here in compound.below():
        if (found := frustum_of(here.statement, name)) is not None:
            return found, WHOLE
    return None


def _shown_eyes(one: Destination) -> frozenset[str]:
    """The panel's eyes; where its compounds draw for none of them, the eyes that they draw for."""
    drawn = {eye for root in one.roots for eye in ALL_EYES if root.draws_for(eye)}
    if not drawn or drawn & one.eyes:
        return one.eyes
    return frozenset(drawn & {"LEFT", "RIGHT"}) or frozenset(drawn)


def _eyes(compound: Compound) -> frozenset[str]:
    """LEFT and RIGHT as the compound, those above it, or those below it name them; else CYCLOP."""
    named = next((here.eyes for here in _above(compound) if here.eyes is not None), None)
    if named is None:
        named = frozenset[str]().union(*(one.eyes for one in compound.below() if one.eyes is not None))
    sides = named & {"LEFT", "RIGHT"}
    return sides or frozenset({"CYCLOP"})
