"""Import ParaView's display configurations (.pvx): one `Machine` a rank, with the corners of its screen.

Read as ParaView reads them (Remoting/Core/vtkDisplayConfiguration.cxx): unknown attributes are ignored, a number
ends at the first character that is not part of it, a screen without corners shows a window of the whole view.
The eye is at the origin.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from wall.core.data import Float64
from wall.importers import xml_source
from wall.importers.panels import (
    METRES_A_PIXEL,
    MOST_EYE_SEPARATION_M,
    Draft,
    configuration,
    corners_of,
    fit_panels,
    upright,
)
from wall.importers.report import Conversion
from wall.importers.source import Node, Source, as_number

NO_GEOMETRY = (1920, 1080)  # pixels assumed for a screen with neither corners nor Geometry
MOST_GEOMETRY = 10**6  # pixels; a larger Geometry is a typing error
LONGEST_DISPLAY = 4096  # characters of an X display's name
ASSUMED_ACROSS = 1920  # pixels along the longest side of a screen whose pixels are not said
STEREO = {"Left": "left", "Right": "right", "SplitViewportHorizontal": "side_by_side"}
ROOT = "pvx"
OFF_AS_HERE = ("ShowBorders", "Coverable", "Show2DOverlays", "FullScreen")
REASONS = {
    "ShowBorders": "windows have no borders",
    "Coverable": "windows stay in front",
    "ViewerId": "one view has one eye; a panel's `eye` can be set by hand",
    "IndependentViewers": "one view has one eye; a panel's `eye` can be set by hand",
    "UseOffAxisProjection": "every panel is seen off-axis, from its corners and the eye",
}

_GEOMETRY = re.compile(r"\s*(\d+)x(\d+)(?:([+-]-?\d+)([+-]-?\d+))?\s*$")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)")


def convert(text: str, name: str) -> Conversion:
    """The configuration of a .pvx file. Raises NotThisFormat with name:line:column."""
    source = Source(name, xml_source.parse(text, name), REASONS)
    if source.root.key != ROOT:
        raise source.refuse(source.root, f"the first element is <{source.root.key}>", f"<{ROOT}>")
    process = _process(source)
    machines = process.children("Machine")
    if not machines:
        raise source.refuse(process, "names no Machine", '<Machine Name="..." Geometry="..."/>')
    screens = [_corners(source, machine) for machine in machines]
    pitch = _pitch(source, machines, screens)
    drafts, beside = [], 0.0
    for machine, corners in zip(machines, screens, strict=True):
        draft = _draft(source, machine, corners, pitch=pitch, beside=beside)
        beside += draft.size[0] if corners is None else 0.0
        drafts.append(draft)
    eye = None if all(corners is None for corners in screens) else np.zeros(3)
    if eye is not None:
        source.assume("The eye is at the origin of the file's coordinates, as in ParaView before the head is tracked.")
        _before_the_eye(source, drafts, screens)
    separation = _eye_separation(source, process)
    _options(source, process, machines)
    panels, eye = fit_panels(source, drafts, eye)
    values = configuration(panels, eye=eye, eye_separation=separation)
    return source.close(values, panels=len(drafts), ranks=len(machines))


def _process(source: Source) -> Node:
    """The element with the machines: the root, or the <Process Type="server"> of older files, else the last one."""
    processes = source.root.children("Process")
    if not processes:
        return source.root
    servers = [p for p in processes if (kind := p.get("Type")) is not None and kind.value == "server"]
    chosen = servers[0] if servers else processes[-1]
    source.carry(chosen.get("Type"), "which machines are read")
    for other in processes:
        if other is not chosen:
            source.drop(other, "another process; ParaView reads the server's machines only")
    return chosen


def _corners(source: Source, machine: Node) -> Float64 | None:
    """(3, 3) corners of a screen; None if the file gives none, or none that span a rectangle."""
    nodes = [machine.get(key) for key in ("LowerLeft", "LowerRight", "UpperRight")]
    if any(node is None for node in nodes):
        for node in nodes:
            source.drop(node, "a screen needs LowerLeft, LowerRight and UpperRight")
        return None
    points = [_point(source, node) for node in nodes if node is not None]
    corners = corners_of(*points)
    for node in nodes:
        if corners is None:
            source.drop(node, "the three corners span no rectangle")
        else:
            source.carry(node, "corners")
    return corners


def _point(source: Source, node: Node) -> list[float]:
    """Three numbers, read as a C++ stream reads them; missing ones are 0."""
    rest, found = str(node.value), []
    for _ in range(3):
        match = _NUMBER.match(rest)
        number = as_number(match[1]) if match else None
        if match is None or number is None:
            break
        found.append(number)
        rest = rest[match.end() :]
        if rest and not rest[0].isspace():
            break
    if len(found) < 3 or rest.strip():
        read = " ".join(f"{value:g}" for value in [*found, 0.0, 0.0, 0.0][:3])
        source.note(node, f"is not three numbers: {read}, as ParaView reads it")
    return found + [0.0] * (3 - len(found))


def _geometry(source: Source, machine: Node) -> tuple[tuple[int, int] | None, dict[str, int] | None]:
    """Pixels and window of Geometry="WxH+X+Y"."""
    node = machine.get("Geometry")
    if node is None or not str(node.value).strip():
        return None, None
    match = _GEOMETRY.match(str(node.value))
    if match is None or not all(0 < int(side[:9]) <= MOST_GEOMETRY for side in match.groups()[:2]):
        source.drop(node, "is not WIDTHxHEIGHT+X+Y")
        return None, None
    source.carry(node, "pixels, window")
    pixels = int(match[1]), int(match[2])
    if match[3] is None:
        return pixels, None
    x, y = (int(part.removeprefix("+")[:9].replace("--", "")) for part in (match[3], match[4]))
    return pixels, {"x": x, "y": y, "width": pixels[0], "height": pixels[1]}


def _pitch(source: Source, machines: list[Node], screens: list[Float64 | None]) -> float:
    """Metres a pixel of screens without Geometry: the longest has ASSUMED_ACROSS pixels."""
    longest = 0.0
    for machine, corners in zip(machines, screens, strict=True):
        if corners is not None and machine.get("Geometry") is None:
            width, height = np.linalg.norm(corners[1] - corners[0]), np.linalg.norm(corners[2] - corners[0])
            longest = max(longest, float(width), float(height))
    if longest:
        source.assume(
            f"Screens without Geometry fill their display, whose pixels the file does not give: {ASSUMED_ACROSS} "
            "along the longest side, and square."
        )
    return longest / ASSUMED_ACROSS or METRES_A_PIXEL


def _draft(source: Source, machine: Node, corners: Float64 | None, *, pitch: float, beside: float) -> Draft:
    """The panel of a machine; `pitch` is metres a pixel, `beside` the left edge, metres, of one without corners."""
    pixels, window = _geometry(source, machine)
    if corners is None:
        width, height = pixels or NO_GEOMETRY
        size = width * METRES_A_PIXEL, height * METRES_A_PIXEL
        corners = upright(beside, 0.0, *size)
        source.assume(
            "Screens without corners stand side by side in the file's order, 0.25 mm a pixel, "
            f"{NO_GEOMETRY[0]}x{NO_GEOMETRY[1]} pixels where Geometry is absent too."
        )
    elif pixels is None:
        sides = [float(np.linalg.norm(corners[k] - corners[0])) for k in (1, 2)]
        pixels = max(1, round(sides[0] / pitch)), max(1, round(sides[1] / pitch))
    others: dict[str, Any] = {}
    label = source.text(machine.get("Name"))
    if label is not None:
        source.carry(machine.get("Name"), "id, host")
        others["host"] = label
        source.assume(
            "A Machine's Name is the panel's id and the host that it hangs on; ParaView itself goes by order."
        )
    others |= _display(source, machine)
    if window is not None:
        others["window"] = window
    return Draft(
        node=machine,
        name=label or "screen",
        pixels=pixels or NO_GEOMETRY,
        corners=corners,
        stereo=_stereo(source, machine),
        others=others,
    )


def _display(source: Source, machine: Node) -> dict[str, str]:
    """The X display of Environment="DISPLAY=:0 OTHER=1"; other variables are not carried."""
    node = machine.get("Environment")
    if node is None:
        return {}
    found = re.search(r"(?:^|\s)DISPLAY=(\S+)", str(node.value))
    rest = re.sub(r"(?:^|\s)DISPLAY=\S+", "", str(node.value)).strip()
    if found is None:
        source.drop(node, "environment variables are set where the ranks are started")
        return {}
    source.carry(node, "display")
    if rest:
        source.note(node, f"{rest}: environment variables are set where the ranks are started")
    return {"display": found[1][:LONGEST_DISPLAY]}


def _stereo(source: Source, machine: Node) -> str:
    """The kind of stereo that a machine shows."""
    node = machine.get("StereoType")
    if node is None:
        return "mono"
    kind = STEREO.get(str(node.value).strip())
    if kind is None:
        source.drop(node, "is not one of mono, left, right, side_by_side, top_bottom")
        return "mono"
    source.carry(node, f"stereo: {kind}")
    return kind


def _options(source: Source, process: Node, machines: list[Node]) -> None:
    """Report as carried what this renderer does anyway: options that are off, the first viewer, off-axis projection."""
    named = [(option.get("Name"), option) for option in process.children("Option")]
    for machine in machines:
        for key in OFF_AS_HERE:
            if source.flag(machine.get(key)) is False:
                source.carry(machine.get(key), "off, as here")
        if source.number(machine.get("ViewerId")) == 0:
            source.carry(machine.get("ViewerId"), "the view")
    for label, option in named:
        if label is not None and label.value in OFF_AS_HERE and source.flag(option.get("Value")) is False:
            source.carry(option, "off, as here")
    for element in process.children("UseOffAxisProjection"):
        if source.flag(element.get("Value")):
            source.carry(element, "off-axis, as here")


def _eye_separation(source: Source, process: Node) -> float | None:
    """Metres of <EyeSeparation Value="..."/>; those of single viewers are not carried."""
    for element in process.children("EyeSeparation"):
        found = source.number(element.get("Value"))
        if found is not None and 0.0 <= found <= MOST_EYE_SEPARATION_M:
            source.carry(element, "views[0].eye_separation")
            return found
        source.drop(element, "is not a distance in metres that can be used")
    return None


def _before_the_eye(source: Source, drafts: list[Draft], screens: list[Float64 | None]) -> None:
    """Put screens without corners two metres before the eye, where other screens have corners."""
    for draft, corners in zip(drafts, screens, strict=True):
        if corners is None:
            draft.corners = draft.corners + np.array([0.0, 0.0, -2.0])
            source.note(draft.node, "has no corners where others have them: it stands two metres before the eye")
