"""Import SGCT's configurations: `nodes` with `windows` with `viewports`, each with a projection, and `users`.

JSON after its schema (sgct.schema.json), and the XML of earlier versions, which wall/importers/sgct_xml.py gives
the same shape. Corners are used as they are; a viewport's position counts from the window's lower left, a window's
from the upper left of the desktop.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wall.core.data import Float64
from wall.importers import json_source, sgct_xml
from wall.importers.panels import FARTHEST_PIXEL, MOST_EYE_SEPARATION_M, MOST_PIXELS, Draft, configuration, fit_panels
from wall.importers.report import Conversion
from wall.importers.sgct_projection import corners_of_projection, is_unit, vector
from wall.importers.source import Node, Source

WINDOW = (640, 480)  # pixels of a window without a size, as SGCT makes it
LARGEST_SHARE = 16.0  # of a viewport in its window; anything beyond is a mistake
REFRESH_HZ = (0.1, 1000.0)  # as a configuration accepts it
LAST_MONITOR = 255  # as a configuration accepts it
STEREO = {"side_by_side": "side_by_side", "top_bottom": "top_bottom"}
INVERTED = {"side_by_side_inverted": "side_by_side", "top_bottom_inverted": "top_bottom"}
NO_STEREO = ("none", "no_stereo")
OFF_AS_HERE = ("border", "fxaa", "hidden", "floating", "swaplock", "firmsync", "tracked", "debuglog", "alpha")
HEAD = "the head runs where the run is started, and ranks find it by themselves"
PICTURES = "files of pictures are not read; blend, colour and warp of a panel do the same by numbers"
TRACKING = "heads are not tracked: the eye stands still"
REASONS = (
    {"blendmask": "masks are not read: blend: auto fades out where panels of one plane overlap"}
    | dict.fromkeys(("masteraddress", "port", "datatransferport", "externalcontrolport"), HEAD)
    | dict.fromkeys(("blacklevelmask", "overlay", "mesh", "scalablemesh"), PICTURES)
    | dict.fromkeys(("tracking", "trackers", "tracked", "matrix"), TRACKING)
    | dict.fromkeys(("msaa", "fxaa"), "the sampler decides how many rays a pixel gets")
    | dict.fromkeys(("swaplock", "firmsync"), "nothing waits for a frame here")
    | dict.fromkeys(("meta", "generator", "$schema"), "says who made the file")
    | dict.fromkeys(("id", "tags"), "windows are known by their panels' ids")
)


@dataclass(slots=True, kw_only=True)
class User:
    """A viewer of the wall, and the eye's position."""

    node: Node | None
    name: str | None
    eye: Float64  # (3,) metres


def convert(text: str, name: str) -> Conversion:
    """The configuration of an SGCT file. Raises NotThisFormat with name:line:column."""
    root = sgct_xml.parse(text, name) if text.lstrip().startswith("<") else json_source.parse(text, name)
    source = Source(name, root, REASONS)
    nodes = root.get("nodes")
    if nodes is None or not nodes.items:
        raise source.refuse(nodes or root, "has no nodes", 'nodes: [{"address": ..., "windows": [...]}]')
    users = _users(source)
    drafts = [draft for k, node in enumerate(nodes.items) for draft in _node(source, node, k, users)]
    if not drafts:
        raise source.refuse(nodes, "have no windows", '"windows": [{"size": ..., "viewports": [...]}]')
    source.carry(root.get("version"), "the version of the format")
    panels, eye = fit_panels(source, drafts, users[0].eye)
    values = configuration(
        panels, eye=eye, eye_separation=_eye_separation(source, users[0]), refresh_hz=_refresh(source)
    )
    _same_as_here(source)
    return source.close(values, panels=len(drafts), ranks=len(drafts))


def _users(source: Source) -> list[User]:
    """All users; the first is the one of viewports that name no user."""
    listed = source.root.get("users")
    found = []
    for node in listed.items if listed is not None else []:
        position = node.get("pos")
        eye = vector(source, position)
        if eye is not None:
            source.carry(position, "eye")
        label = source.text(node.get("name"))
        source.carry(node.get("name"), "which viewports are this user's")
        found.append(User(node=node, name=label, eye=np.zeros(3) if eye is None else eye))
    if not found:
        source.assume("The file has no user: the eye is at the origin of its coordinates.")
        return [User(node=None, name=None, eye=np.zeros(3))]
    first = next((k for k, user in enumerate(found) if user.name is None), 0)
    return [found[first], *found[:first], *found[first + 1 :]]


def _eye_separation(source: Source, user: User) -> float | None:
    """Metres between a user's eyes; None where the file says nothing usable."""
    node = user.node.get("eyeseparation") if user.node is not None else None
    found = source.number(node)
    if found is None or not 0.0 <= found <= MOST_EYE_SEPARATION_M:
        return None
    source.carry(node, "views[0].eye_separation")
    return found


def _refresh(source: Source) -> float | None:
    """The display's refresh rate, Hz; None where the file says nothing usable."""
    settings = source.root.get("settings")
    display = settings.get("display") if settings is not None else None
    node = display.get("refreshrate") if display is not None else None
    found = source.number(node)
    if found is None or not REFRESH_HZ[0] <= found <= REFRESH_HZ[1]:
        return None
    source.carry(node, "views[0].refresh_hz")
    return found


def _node(source: Source, node: Node, index: int, users: list[User]) -> list[Draft]:
    """The panels of a machine's windows."""
    address = source.text(node.get("address"))
    source.carry(node.get("address"), "host")
    windows = node.get("windows")
    found = []
    for k, window in enumerate(windows.items if windows is not None else []):
        found += _window(source, window, f"n{index}w{k}", users, address)
    return found


def _window(source: Source, window: Node, name: str, users: list[User], host: str | None) -> list[Draft]:
    """The panels of a window: one a viewport; `name` is their id where the file gives none."""
    size = _pixels(source, window)
    position = _window_position(source, window)
    stereo = _stereo(source, window)
    others: dict[str, Any] = {} if host is None else {"host": host}
    monitor = source.whole(window.get("monitor"))
    if monitor is not None and monitor <= LAST_MONITOR:
        source.carry(window.get("monitor"), "monitor" if monitor >= 0 else "the first monitor, as here")
        others |= {"monitor": monitor} if monitor >= 0 else {}
    others |= _mirrored(source, window)
    listed = window.get("viewports")
    viewports = listed.items if listed is not None and listed.items else [window]
    label = _label(source, window)
    found = []
    for k, viewport in enumerate(viewports):
        low, share = _share(source, viewport) if viewport is not window else (np.zeros(2), np.ones(2))
        pixels = max(1, round(float(share[0]) * size[0])), max(1, round(float(share[1]) * size[1]))
        user = _user_of(source, viewport, users)
        corners = corners_of_projection(source, viewport, pixels, user.eye)
        draft = Draft(
            node=viewport,
            name=(viewport is not window and _label(source, viewport))
            or (label or name) + (f"-v{k}" if len(viewports) > 1 else ""),
            pixels=pixels,
            corners=corners,
            eye=None if user is users[0] else user.eye,
            stereo=_eye_of(source, viewport) or stereo,
            others=dict(others),
        )
        if viewport.get("blendmask") is not None:
            draft.others["blend"] = "auto"
        if position is not None or len(viewports) > 1:
            draft.others |= _window_of(position or (0, 0), size, low, pixels)
        found.append(draft)
    return found


def _label(source: Source, node: Node) -> str | None:
    """The name of a window or viewport, for its panel's id."""
    source.carry(node.get("name"), "id")
    return source.text(node.get("name"))


def _pixels(source: Source, window: Node) -> tuple[int, int]:
    """A window's width and height, pixels. Raises NotThisFormat for a size below 1."""
    node = window.get("size")
    sides = [source.whole(node.get(axis)) if node is not None else None for axis in "xy"]
    if sides[0] is None or sides[1] is None:
        source.note(window, f"has no size: {WINDOW[0]}x{WINDOW[1]} pixels, as SGCT makes windows")
        return WINDOW
    if min(sides[0], sides[1]) < 1:
        raise source.refuse(node or window, f"is {sides[0]} x {sides[1]}", "pixels above 0")
    source.carry(node, "pixels")
    source.drop(window.get("res"), "pictures have as many pixels as their window")
    return sides[0], sides[1]


def _window_position(source: Source, window: Node) -> tuple[int, int] | None:
    """A window's position on the desktop, pixels from its upper left; None if it fills its display."""
    node, fullscreen = window.get("pos"), source.flag(window.get("fullscreen")) or False
    source.carry(window.get("fullscreen"), "no window" if fullscreen else "window")
    if node is not None:
        x, y = source.whole(node.get("x")), source.whole(node.get("y"))
        if x is not None and y is not None and max(abs(x), abs(y)) <= FARTHEST_PIXEL:
            source.carry(node, "window")
            return None if fullscreen and (x, y) == (0, 0) else (x, y)
        source.drop(node, "is not a place on a desktop")
    return None if fullscreen else (0, 0)


def _window_of(
    position: tuple[int, int], size: tuple[int, int], low: Float64, pixels: tuple[int, int]
) -> dict[str, Any]:
    """The part of the desktop that a viewport covers; `low` is its lower left in shares of the window."""
    x = position[0] + round(float(low[0]) * size[0])
    top = position[1] + size[1] - round(float(low[1]) * size[1]) - pixels[1]
    if max(pixels) > MOST_PIXELS or max(abs(x), abs(top)) > FARTHEST_PIXEL:
        return {}
    return {"window": {"x": x, "y": top, "width": pixels[0], "height": pixels[1]}}


def _share(source: Source, viewport: Node) -> tuple[Float64, Float64]:
    """Lower left and size of a viewport as shares of its window; the whole window where the file does not say."""
    found = []
    for key, otherwise in (("pos", 0.0), ("size", 1.0)):
        node = viewport.get(key)
        parts = [source.number(node.get(axis)) if node is not None else None for axis in "xy"]
        usable = all(part is not None and abs(part) <= LARGEST_SHARE for part in parts)
        if usable and (key == "pos" or min(p for p in parts if p is not None) > 0):
            source.carry(node, "pixels, window")
            found.append(np.array(parts, dtype=np.float64))
        else:
            source.drop(node, "is not a part of the window: all of it instead")
            found.append(np.full(2, otherwise))
    return found[0], found[1]


def _user_of(source: Source, viewport: Node, users: list[User]) -> User:
    """The user that a viewport names, else the first."""
    node = viewport.get("user")
    label = source.text(node)
    if label is None:
        return users[0]
    for user in users:
        if user.name == label:
            source.carry(node, "eye")
            return user
    source.drop(node, "no user has this name: the first one instead")
    return users[0]


def _stereo(source: Source, window: Node) -> str:
    """The kind of stereo that a window shows."""
    node = window.get("stereo")
    if node is None:
        return "mono"
    kind = str(node.value).strip().lower()
    if kind in INVERTED:
        source.note(node, "the eyes have each other's place here: left comes first")
    if kind in NO_STEREO or kind in STEREO or kind in INVERTED:
        source.carry(node, "stereo")
        return STEREO.get(kind) or INVERTED.get(kind) or "mono"
    source.drop(node, "is not one of side_by_side, top_bottom: one picture for both eyes instead")
    return "mono"


def _eye_of(source: Source, viewport: Node) -> str | None:
    """The one eye that a viewport is for; None for both."""
    node = viewport.get("eye")
    kind = source.text(node)
    if kind not in ("left", "right", "center"):
        return None
    source.carry(node, "stereo")
    return None if kind == "center" else kind


def _mirrored(source: Source, window: Node) -> dict[str, Any]:
    """The warp that does what mirrorx and mirrory say; empty if they are off."""
    across, down = (source.flag(window.get(key)) or False for key in ("mirrorx", "mirrory"))
    for key in ("mirrorx", "mirrory"):
        source.carry(window.get(key), "warp" if across or down else "off, as here")
    if not across and not down:
        return {}
    x, y = (1, 0) if across else (0, 1), (1, 0) if down else (0, 1)
    points = [[x[i], y[k]] for k in (0, 1) for i in (0, 1)]
    return {"warp": {"columns": 2, "rows": 2, "points": points}}


def _same_as_here(source: Source) -> None:
    """Report as carried what this renderer does anyway: options that are off, a scene that is not moved."""
    scene = source.root.get("scene")
    if scene is not None and is_unit(source, scene):
        source.carry(scene, "the scene as it is, as here")
    stack = [source.root]
    while stack:
        node = stack.pop()
        for inner in node.inside():
            stack.append(inner)
            if inner.kind == "value" and inner.key in OFF_AS_HERE and source.flag(inner) is False:
                source.carry(inner, "off, as here")
