"""Convert the tree of SGCT's earlier XML to the shape of its JSON: same keys, with the XML's lines and names.

<Cluster><Node><Window><Viewport> become nodes, windows, viewports; <Viewplane> with its three <Pos> becomes the
projection ProjectionPlane; heading and azimuth are yaw, elevation is pitch, bank is roll. In the oldest files a
node's one window has its <Viewport> or <Viewplane> beside it.
"""

from __future__ import annotations

from dataclasses import replace

from wall.importers import xml_source
from wall.importers.report import NotThisFormat
from wall.importers.source import Node

ROOT = "Cluster"
LISTS = {"node": "nodes", "window": "windows", "viewport": "viewports", "user": "users", "tracker": "trackers"}
PROJECTIONS = (
    "planarprojection",
    "fisheyeprojection",
    "sphericalmirrorprojection",
    "spoutoutputprojection",
    "cubemapprojection",
    "cylindricalprojection",
    "equirectangularprojection",
    "texturemappedprojection",
)
PLANE = ("viewplane", "projectionplane")
CORNERS = ("lowerleft", "upperleft", "upperright")
RENAMED = {
    "ip": "address",
    "heading": "yaw",
    "azimuth": "yaw",
    "elevation": "pitch",
    "bank": "roll",
    "numberofsamples": "msaa",
    "mask": "blendmask",
    "blendmasktexture": "blendmask",
    "overlaytexture": "overlay",
    "blacklevelmasktexture": "blacklevelmask",
    "correctionmesh": "mesh",
}


def parse(text: str, name: str) -> Node:
    """The tree in the shape of SGCT's JSON. Raises NotThisFormat with name:line:column."""
    root = xml_source.parse(text, name)
    if root.key != ROOT:
        where = f"{name}:{root.line}:{root.column}"
        raise NotThisFormat(f"{where}: the first element is <{root.key}>; accepted: <{ROOT}>")
    return _shaped(root)


def _shaped(element: Node) -> Node:
    """An element with its attributes and children as members."""
    found = replace(element, fields={}, items=[])
    for key, attribute in element.fields.items():
        _put(found, _key(key), attribute)
    for child in element.items:
        _add(found, child)
    return found


def _add(parent: Node, child: Node) -> None:
    """Add a child element to its parent as JSON has it: in a list, as the projection, or as a member."""
    tag = child.key.lower()
    if tag in LISTS:
        listed = parent.fields.get(LISTS[tag])
        if listed is None:
            listed = Node(name=child.name, line=child.line, column=child.column, kind="list", key=LISTS[tag])
            parent.fields[LISTS[tag]] = listed
        shaped = _shaped(child)
        listed.items.append(_with_window(shaped) if tag == "node" else shaped)
    elif tag in PLANE:
        _put(parent, "projection", _plane(child))
    elif tag in PROJECTIONS:
        projection = _shaped(child)
        projection.fields["type"] = _type(child, child.key)
        _put(parent, "projection", projection)
    elif tag == "stereo" and (kind := child.get("type")) is not None:
        _put(parent, "stereo", kind)
    elif set(child.fields) == {"value"} and not child.items:
        _put(parent, _key(tag), child.fields["value"])
    else:
        _put(parent, _key(tag), _shaped(child))


def _with_window(node: Node) -> Node:
    """A node of the oldest files with its viewports moved into its first window."""
    windows = node.fields.get("windows")
    if windows is None:
        return node
    window = windows.items[0]
    if "viewports" not in window.fields and "viewports" in node.fields:
        window.fields["viewports"] = node.fields.pop("viewports")
    if "viewports" not in window.fields and "projection" in node.fields:
        plane = node.fields.pop("projection")
        around = replace(plane, kind="object", key="viewport", fields={"projection": plane}, items=[])
        window.fields["viewports"] = replace(plane, kind="list", key="viewports", fields={}, items=[around])
    return node


def _plane(element: Node) -> Node:
    """<Viewplane> with <Pos> for the lower left, upper left and upper right corner, in this order."""
    found = replace(element, fields={}, items=[])
    found.fields["type"] = _type(element, "ProjectionPlane")
    for key, attribute in element.fields.items():
        _put(found, _key(key), attribute)
    corners = iter(CORNERS)
    for child in element.items:
        corner = next(corners, None) if child.key.lower() == "pos" else None
        _put(found, corner or _key(child.key), _shaped(child))
    return found


def _type(element: Node, value: str) -> Node:
    """The member `type` that JSON's projections have."""
    return Node(name=element.name, line=element.line, column=element.column, kind="value", key="type", value=value)


def _key(name: str) -> str:
    """JSON's key for a tag or an attribute."""
    return RENAMED.get(name.lower(), name.lower())


def _put(parent: Node, key: str, node: Node) -> None:
    """Set a member; a second one of the same key becomes an item, to be listed as not carried."""
    node.key = key
    if key in parent.fields:
        parent.items.append(node)
    else:
        parent.fields[key] = node
