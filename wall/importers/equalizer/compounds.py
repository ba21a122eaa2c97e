"""The compound tree: which channel renders which part of a panel, from which part of the scene, for which frame.

The tree is walked as Equalizer's server does. Each channel has a frame buffer; a leaf draws into its channel's, input
frames are assembled into it, output frames are read back from it. A pixel of the panel is then traced back through
the frames: to the parts of the scene's objects that are joined by depth, and the channels that join them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from wall.core.errors import ConfigError
from wall.importers.equalizer.frusta import WHOLE, View, viewport_of, within
from wall.importers.equalizer.grammar import Statement
from wall.importers.equalizer.resources import Channel, Rect

ALL_EYES = frozenset({"CYCLOP", "LEFT", "RIGHT"})
ALL_TASKS = frozenset({"CLEAR", "DRAW", "ASSEMBLE", "READBACK"})
SHARING = ("pixel", "subpixel", "period")  # ways to share a panel; here each sharer is a rank with its own region
BALANCERS = ("load_equalizer", "tree_equalizer", "loadBalancer")
MOST_QUERIES = 100_000  # steps of tracing one panel; frames that form circles may take exponentially many

Range = tuple[float, float]
EVERYTHING: Range = (0.0, 1.0)
LEAST_RANGE = 1e-6  # of the scene


@dataclass(slots=True, eq=False)
class Compound:
    """One node of the tree, with its own values; None where it inherits them."""

    statement: Statement
    parent: Compound | None
    channel: Channel | None = None  # its own
    target: object | None = None  # instead: a destination on a canvas
    children: list[Compound] = field(default_factory=list)
    view: View = WHOLE
    range: Range | None = None
    eyes: frozenset[str] | None = None
    tasks: frozenset[str] | None = None
    buffers: frozenset[str] | None = None

    def __post_init__(self) -> None:
        block = self.statement
        self.view = viewport_of(block)
        if (numbers := block.numbers("range")) is not None:
            self.range = self._range(max(0.0, numbers[0]), min(1.0, numbers[1]))
        self.eyes, self.tasks, self.buffers = (_words(block, word) for word in ("eye", "task", "buffer"))

    def _range(self, low: float, high: float) -> Range | None:
        """A part of the scene; None, and reported as not carried, where it is empty."""
        if high - low >= LEAST_RANGE:
            return low, high
        for one in self.statement.all("range"):
            one.drop("no part of the scene lies in it: the compound draws what the one above it does")
        return None

    @property
    def names_channel(self) -> bool:
        """Whether it names a channel."""
        return self.channel is not None or self.target is not None

    @property
    def draws(self) -> bool:
        """Whether it or a compound below it draws."""
        if self.children:
            return any(child.draws for child in self.children)
        return "DRAW" in (ALL_TASKS if self.tasks is None else self.tasks)

    def draws_for(self, eye: str) -> bool:
        """Whether it or a compound below it draws for an eye that no compound between excludes."""
        here: Compound | None = self
        while here is not None:
            if here.eyes is not None and eye not in here.eyes:
                return False
            here = here.parent
        return any(child.draws_for(eye) for child in self.children) if self.children else self.draws

    @property
    def inherited_buffers(self) -> frozenset[str]:
        """The buffers of its frames that name none: its own, or those of the nearest compound above."""
        if self.buffers is not None:
            return self.buffers
        return self.parent.inherited_buffers if self.parent is not None else frozenset({"COLOR"})

    def below(self) -> Iterator[Compound]:
        """The compound and all below it."""
        yield self
        for child in self.children:
            yield from child.below()

    def share_ranges(self) -> None:
        """Give each child an equal part of the scene where the source balances ranges at run time."""
        mode = {str(one.values[0]) for block in self.statement.all(*BALANCERS) for one in block.all("mode")}
        drawing = [child for child in self.children if child.draws]
        if "DB" in mode and len(drawing) > 1 and all(child.range is None for child in drawing):
            for i, child in enumerate(drawing):
                child.range = (i / len(drawing), (i + 1) / len(drawing))


def _words(block: Statement, word: str) -> frozenset[str] | None:
    """The words after a word of a block, reported as carried; None if it is missing."""
    found = block.last(word)
    if found is None:
        return None
    found.carry()
    return frozenset(str(value) for value in found.values)


@dataclass(frozen=True, slots=True)
class Draw:
    """Pixels that a leaf rendered, of a part of the scene."""

    leaf: Compound
    where: object  # the channel
    range: Range


@dataclass(frozen=True, slots=True)
class Join:
    """Pixels compared by depth on a channel."""

    where: object
    parts: tuple[Part, ...]


Part = Draw | Join


@dataclass(frozen=True, slots=True)
class _Step:
    """One operation on a frame buffer."""

    kind: str  # clear, draw, assemble
    rect: Rect
    draw: Draw | None = None
    name: str = ""


@dataclass(frozen=True, slots=True)
class _Frame:
    """An output frame: a channel's buffer after the first `steps` steps."""

    where: object
    steps: int
    rect: Rect
    depth: bool


@dataclass(frozen=True, slots=True)
class _Inherited:
    """The values that a compound passes to its children."""

    where: object
    label: str
    view: View
    range: Range
    buffers: frozenset[str]


class Trace:
    """Traces the pixels of a panel back to the compounds of its destination that render them, for one eye."""

    def __init__(self, roots: list[Compound], *, label: str, eye: str, pixels: tuple[int, int], name: str) -> None:
        self._eye, self._pixels, self._queries = eye, pixels, 0
        self._refusal = (
            f"{name}:{roots[0].statement.line if roots else 1}:1: compounds take each other's frames in too many ways; "
            f"wanted: at most {MOST_QUERIES} ways through them"
        )
        self._own = {root.channel for root in roots if root.channel is not None}
        self._steps: dict[object, list[_Step]] = {}
        self._frames: dict[str, list[_Frame]] = {}
        self._cuts: tuple[set[int], set[int]] = ({0, pixels[0]}, {0, pixels[1]})
        self.unknown: list[Statement] = []  # input frames that no compound of the destination outputs
        self._asked: list[tuple[Statement, str]] = []
        for root in roots:
            self._visit(root, _Inherited("panel", label, WHOLE, EVERYTHING, root.inherited_buffers), top=True)
        self.unknown = [block for block, name in self._asked if name not in self._frames]

    def cells(self) -> list[tuple[Rect, Part | None]]:
        """Rectangles of the panel (pixels from its top left) with the part that each shows; None: nothing."""
        xs, ys = (sorted(cut) for cut in self._cuts)
        found = []
        for y0, y1 in pairwise(ys):
            for x0, x1 in pairwise(xs):
                parts = self._at("panel", len(self._steps.get("panel", ())), (x0, y0), frozenset())
                found.append(((x0, y0, x1 - x0, y1 - y0), joined(parts, "panel")))
        return found

    def _visit(self, compound: Compound, above: _Inherited, *, top: bool = False) -> None:
        """Record the steps and frames of a compound and of those below it."""
        if compound.eyes is not None and self._eye not in compound.eyes:
            return
        channel = compound.channel
        where = "panel" if top or channel in self._own else channel
        size = above.range[1] - above.range[0]
        own = compound.range or EVERYTHING
        here = _Inherited(
            where=above.where if channel is None else where,
            label=above.label if channel is None else channel.name,
            view=above.view if top else within(above.view, compound.view),
            range=(round(above.range[0] + own[0] * size, 6), round(above.range[0] + own[1] * size, 6)),
            buffers=above.buffers if compound.buffers is None else compound.buffers,
        )
        tasks = ALL_TASKS if compound.tasks is None else compound.tasks
        steps = self._steps.setdefault(here.where, [])
        if not compound.children:
            rect = self._rect(here.view)
            if "CLEAR" in tasks:
                steps.append(_Step("clear", rect))
            if "DRAW" in tasks:
                steps.append(_Step("draw", rect, Draw(compound, here.where, here.range)))
        for child in compound.children:
            self._visit(child, here)
        self._exchange(compound, here, tasks)

    def _exchange(self, compound: Compound, here: _Inherited, tasks: frozenset[str]) -> None:
        """Record its input frames, then its output frames."""
        steps = self._steps[here.where]
        for block in compound.statement.all("inputframe"):
            name = _frame_name(block, here.label)
            if "ASSEMBLE" in tasks:
                self._asked.append((block, name))
                steps.append(_Step("assemble", self._rect(within(here.view, viewport_of(block))), name=name))
        for block in compound.statement.all("outputframe"):
            if "READBACK" not in tasks:
                continue
            buffers = _words(block, "buffer") or here.buffers
            rect = self._rect(within(here.view, viewport_of(block)))
            frame = _Frame(here.where, len(steps), rect, "DEPTH" in buffers)
            self._frames.setdefault(_frame_name(block, here.label), []).append(frame)

    def _rect(self, view: View) -> Rect:
        """A part of the panel in whole pixels, from its top left; its edges become cuts between cells."""
        w, h = self._pixels
        x0, x1 = (min(w, max(0, round(edge * w))) for edge in (view[0], view[0] + view[2]))
        y0, y1 = (min(h, max(0, round((1 - edge) * h))) for edge in (view[1] + view[3], view[1]))
        self._cuts[0].update((x0, x1))
        self._cuts[1].update((y0, y1))
        return x0, y0, x1 - x0, y1 - y0

    def _at(self, where: object, count: int, point: tuple[int, int], asked: frozenset[object]) -> list[Part]:
        """The parts in a channel's buffer at a pixel after `count` steps. Raises ConfigError after MOST_QUERIES."""
        self._queries += 1
        if self._queries > MOST_QUERIES:
            raise ConfigError(self._refusal)
        if (where, count) in asked:  # frames in a circle add nothing
            return []
        asked, shown = asked | {(where, count)}, list[Part]()
        for step in self._steps.get(where, [])[:count]:
            if not _holds(step.rect, point):
                continue
            if step.kind == "clear":
                shown = []
            elif step.draw is not None:
                shown.append(step.draw)
            for frame in self._frames.get(step.name, ()) if step.kind == "assemble" else ():
                if _holds(frame.rect, point):
                    parts = self._at(frame.where, frame.steps, point, asked)
                    shown = _assembled(shown, parts, frame)
        return shown


def joined(parts: list[Part], where: object) -> Part | None:
    """Several parts as one, joined on that channel; None if there are none."""
    if len(parts) < 2:
        return parts[0] if parts else None
    return Join(where, tuple(parts))


def draws_of(part: Part) -> Iterator[Draw]:
    """All draws in a part."""
    if isinstance(part, Draw):
        yield part
        return
    for one in part.parts:
        yield from draws_of(one)


def _assembled(shown: list[Part], parts: list[Part], frame: _Frame) -> list[Part]:
    """The parts after a frame is assembled: joined by depth, or replaced by a frame of more of the scene."""
    new = joined(parts, frame.where)
    if new is None:
        return shown
    if frame.depth:
        return [*shown, new]
    there = {draw.range for part in shown for draw in draws_of(part)}
    come = {draw.range for draw in draws_of(new)}
    return [new] if there < come else [*shown, new]


def _holds(rect: Rect, point: tuple[int, int]) -> bool:
    """Whether a pixel is inside a rectangle."""
    return rect[0] <= point[0] < rect[0] + rect[2] and rect[1] <= point[1] < rect[1] + rect[3]


def _frame_name(block: Statement, label: str) -> str:
    """A frame's own name, else the default name of its channel's frames."""
    return block.text("name") or f"frame.{label}"
