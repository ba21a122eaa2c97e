"""Read canvases and layouts: which part of which segment shows which view, and the corners of that part.

A canvas shows one of its layouts at a time; the first is the one that a run begins with, and it is carried.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.importers.equalizer.compounds import ALL_EYES
from wall.importers.equalizer.frusta import View, common, frustum_of, relative, viewport_of
from wall.importers.equalizer.grammar import Statement
from wall.importers.equalizer.resources import Channel, Resources


@dataclass(slots=True, eq=False)
class SegmentView:
    """The part of a view that one segment shows."""

    segment: Statement
    view: Statement | None  # None: the canvas names no layout
    channel: Channel
    part: View  # of the channel
    corners: Float64 | None  # (3, 3) metres; None: the file says nothing
    eyes: frozenset[str]
    observer: Statement | None


def read_canvases(config: Statement, resources: Resources, name: str) -> list[SegmentView]:
    """The views on all segments, in the order of the file; unknown names are reported as not carried."""
    found: list[SegmentView] = []
    for canvas in config.all("canvas"):
        views = _views(config, canvas, name)
        whole = frustum_of(canvas, name)
        for segment in canvas.all("segment"):
            before = len(found)
            channel = _channel(segment, resources, name)
            own, viewport = frustum_of(segment, name), viewport_of(segment)
            for view, seen in views if channel is not None else ():
                overlap = common(viewport, seen)
                if channel is None or overlap is None:
                    continue
                of_view = frustum_of(view, name) if view is not None else None
                corners = (
                    of_view.part(relative(overlap, seen)) if of_view
                    else own.part(relative(overlap, viewport)) if own
                    else whole.part(overlap) if whole else None
                )  # fmt: skip
                eyes = _eyes(segment, view)
                observer = _observer(config, view, name) if view is not None else None
                part = relative(overlap, viewport)
                found.append(SegmentView(segment, view, channel, part, corners, eyes, observer))
            if len(found) == before and channel is not None:
                segment.drop("no view of the layout lies on it")
    return _with_eyes(found)


def find(blocks: list[Statement], key: Statement, name: str) -> Statement:
    """The block that a name or an index refers to. Raises ConfigError that lists the blocks there are."""
    value, kind = key.values[0], key.word
    if isinstance(value, str):
        for block in blocks:
            if _name(block) == value:
                return block
    elif int(value) < len(blocks):
        return blocks[int(value)]
    shown = f'"{value}"' if isinstance(value, str) else f"{value:g}"
    known = ", ".join(f'"{_name(block)}"' for block in blocks if _name(block))
    there = f"0 to {len(blocks) - 1}" if blocks else f"there is no {kind} before this line"
    wanted = ", ".join(part for part in (there, known) if part)
    raise ConfigError(f"{name}:{key.line}:{key.column}: no {kind} {shown}; wanted: {wanted}")


def _name(block: Statement) -> str:
    """A block's name, empty if it has none."""
    names = block.all("name")
    return str(names[-1].values[0]) if names else ""


def _views(config: Statement, canvas: Statement, name: str) -> list[tuple[Statement | None, View]]:
    """Views of the canvas's first layout, each with its part of the canvas."""
    active: Statement | None = None
    for key in canvas.all("layout"):
        if key.values[0] == "OFF":
            key.drop("a canvas is not switched off here")
            continue
        try:
            layout = find(config.all("layout"), key, name)
        except ConfigError as error:
            key.drop(_without_name(error, name))
            continue
        if active is None:
            active = layout
            key.carry("the layout that a run begins with")
            layout.carry()
            layout.text("name")
        elif layout is not active:
            key.drop(f"layouts are not switched as it runs; the first, of line {active.line}, is carried over")
    if active is None:
        return [(None, (0.0, 0.0, 1.0, 1.0))]
    return [(view, viewport_of(view)) for view in active.all("view")]


def drop_other_layouts(config: Statement, shown: list[SegmentView]) -> None:
    """Report every layout that no canvas begins with as not carried."""
    used = {id(one.view.parent) for one in shown if one.view is not None}
    for layout in config.all("layout"):
        if id(layout) not in used:
            _drop_all(layout, f"layout of line {layout.line}: layouts are not switched as it runs")


def _drop_all(block: Statement, why: str) -> None:
    """Report a block and all inside it as not carried."""
    for one in block.walk():
        one.drop(why)


def _channel(segment: Statement, resources: Resources, name: str) -> Channel | None:
    """A segment's channel; None, and the segment reported as not carried, if there is none."""
    key = segment.last("channel")
    if key is None:
        segment.drop("no channel shows it")
        return None
    key.carry()
    channel = resources.named(str(key.values[0]))
    if channel is None:
        _drop_all(segment, _without_name(unknown_channel(key, resources, name), name))
    return channel


def _without_name(error: ConfigError, name: str) -> str:
    """An error's text without the file's name."""
    return str(error).removeprefix(f"{name}:")


def unknown_channel(key: Statement, resources: Resources, name: str) -> ConfigError:
    """The error for a channel that is not there."""
    known = ", ".join(f'"{channel.name}"' for channel in resources.channels if channel.name) or "a channel with a name"
    return ConfigError(f'{name}:{key.line}:{key.column}: no channel "{key.values[0]}"; wanted: {known}')


def _eyes(segment: Statement, view: Statement | None) -> frozenset[str]:
    """The eyes that a segment shows of a view: the segment's, restricted to those of the view's mode."""
    key = segment.last("eye")
    own = ALL_EYES
    if key is not None:
        key.carry()
        own = frozenset(str(value) for value in key.values) or ALL_EYES
    mode = view.last("mode") if view is not None else None
    if mode is not None:
        mode.carry()
    stereo = mode is not None and mode.values[0] == "STEREO"
    return own & (frozenset({"LEFT", "RIGHT"}) if stereo else frozenset({"CYCLOP"}))


def _observer(config: Statement, view: Statement, name: str) -> Statement | None:
    """A view's observer; None if it names none that is there."""
    key = view.last("observer")
    if key is None:
        return None
    key.carry()
    try:
        return find(config.all("observer"), key, name)
    except ConfigError as error:
        key.drop(_without_name(error, name))
        return None


def _with_eyes(found: list[SegmentView]) -> list[SegmentView]:
    """The views that show an eye; where none does, each shows the eyes that its segment names."""
    for one in found if not any(one.eyes for one in found) else ():
        key = one.segment.last("eye")
        one.eyes = frozenset(str(value) for value in key.values) if key is not None else frozenset({"CYCLOP"})
    for one in found:
        if not one.eyes:
            one.segment.drop("it shows eyes that the view's mode does not use")
    return [one for one in found if one.eyes]


def targets(config: Statement, key: Statement, name: str) -> Iterator[Statement]:
    """The segment, then the view, that a compound's ( canvas segment layout view ) refers to."""
    words = {one.word: one for one in key.body or ()}
    for one in words.values():
        one.carry()
    canvases, layouts = config.all("canvas"), config.all("layout")
    canvas = find(canvases, words["canvas"], name) if "canvas" in words else None
    yield _inside(canvases, canvas, "segment", words.get("segment"), key, name)
    layout = find(layouts, words["layout"], name) if "layout" in words else None
    yield _inside(layouts, layout, "view", words.get("view"), key, name)


def _inside(
    blocks: list[Statement], block: Statement | None, word: str, key: Statement | None, at: Statement, name: str
) -> Statement:
    """A segment or view of a block by name or index; without a block by name in all of them, by index in the first."""
    by_name = key is not None and isinstance(key.values[0], str)
    parents = [block] if block is not None else (blocks if by_name else blocks[:1])
    parts = [part for parent in parents for part in parent.all(word)]
    if key is not None:
        return find(parts, key, name)
    if not parts:
        raise ConfigError(f"{name}:{at.line}:{at.column}: no {word} for this channel; wanted: a {word} before it")
    return parts[0]
