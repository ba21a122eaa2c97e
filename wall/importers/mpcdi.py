"""Import MPCDI (VESA Multiple Projection Common Data Interchange 1.0 and 2.0): one panel a region, a projector.

Profiles: `2d` (regions of a flat image), `3d` (a frustum each from one eye), `a3` (the point that each pixel lights),
`sl` (shader lamps: each projector is the eye). A region's geometry warp tells for each of its pixels, the first row at
the top, where in the region's own image it looks: 0..1 across, and from the bottom up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.importers import mpcdi_files, xml_source
from wall.importers.archive import Files
from wall.importers.mpcdi_files import GAMMA
from wall.importers.panels import (
    DISTANCE_M,
    METRES_A_PIXEL,
    MOST_PIXELS,
    WIDEST,
    Draft,
    configuration,
    fit_panels,
    turned,
    upright,
)
from wall.importers.report import Conversion
from wall.importers.source import Node, Source

PROFILES = ("2d", "3d", "a3", "sl")
METRES = {"mm": 1e-3, "cm": 0.01, "dm": 0.1, "m": 1.0, "in": 0.0254, "ft": 0.3048, "yd": 0.9144}
STEEPEST = 80.0  # degrees of a point from straight before the panel that stands in for a bent screen
EYE_HEIGHT_M = 1.7  # of who stands at the centre of a floor
OUTSIDE = 1e-3  # of a region's width: positions farther out are shown nowhere
REASONS = {
    "betamap": "black levels are not raised",
    "geometry": "what there is of geometry is read, whatever its level",
    "color": "what there is of colour is read, whatever its level",
    "extensionset": "extensions are not read",
    "date": "says when the file was made",
    "version": "1.0 and 2.0 are read alike",
}


@dataclass(slots=True, kw_only=True)
class Region:
    """A region with what belongs to it."""

    node: Node
    name: str
    pixels: tuple[int, int]
    fileset: Node | None


def convert(text: str, name: str, files: Files | None = None) -> Conversion:
    """The configuration of an mpcdi.xml. Raises NotThisFormat with name:line:column.

    `files`: what it names, if they are there; those that are needed go to the conversion's files.
    """
    source = Source(name, xml_source.parse(text, name), REASONS)
    if source.root.key != "MPCDI":
        raise source.refuse(source.root, f"the first element is <{source.root.key}>", "<MPCDI>")
    profile = str(getattr(_field(source.root, "profile"), "value", None) or "").lower()
    if profile not in PROFILES:
        raise source.refuse(source.root, f"profile is {profile or 'not said'}"[:80], ", ".join(PROFILES))
    source.carry(_field(source.root, "profile"), "how regions become panels")
    return _Importer(source, profile, files).conversion()


class _Importer:
    """One conversion."""

    def __init__(self, source: Source, profile: str, files: Files | None) -> None:
        self._source, self._profile, self._files = source, profile, files
        self._made: dict[str, bytes] = {}
        self._filesets = {_said(each, "region"): each for each in _all(source.root, "fileset")}
        self._eye = np.zeros(3)

    def conversion(self) -> Conversion:
        source, left, drafts = self._source, 0.0, list[Draft]()
        buffers = _all(source.root, "buffer")
        for buffer in buffers:
            source.carry(_field(buffer, "id"), "names a part of the wall")
            size = self._size(buffer)
            metres = METRES_A_PIXEL * np.array(size or (0, 0), np.float64)
            for node in _all(buffer, "region"):
                if (region := self._region(node, size)) is not None and (draft := self._draft(region, left, metres)):
                    drafts.append(draft)
            left += float(metres[0])
        if not drafts:
            raise source.refuse(source.root, "has no region that can be shown", "<buffer> with <region>")
        eye: Float64 | None = self._eye
        if self._profile == "2d":
            eye = None
            ends = np.array([draft.corners for draft in drafts]).reshape(-1, 3)
            for draft in drafts:
                draft.corners -= (ends.min(axis=0) + ends.max(axis=0)) / 2.0
            source.assume(f"The image is flat, {1e3 * METRES_A_PIXEL:g} mm a pixel: the file says no lengths.")
        elif self._profile == "sl":
            eye = None
            source.assume("Every projector is the eye of its panel: the scene stands where the surface does.")
        else:
            source.assume(f"The eye is at [{', '.join(f'{x:g}' for x in self._eye)}]; x is right, y up, z backwards.")
        if any("blend_mask" in draft.others for draft in drafts):
            source.assume(f"Projectors emit light = value ^ {GAMMA}; masks are for that.")
        panels, eye = fit_panels(source, drafts, eye)
        made = source.close(configuration(panels, eye=eye), panels=len(drafts), ranks=len(drafts))
        made.files = self._made
        return made

    def _size(self, node: Node) -> tuple[int, int] | None:
        """Pixels of a buffer or region; None where it does not say."""
        sides = []
        for key in ("xResolution", "yResolution"):
            side = self._source.whole(_field(node, key))
            if side is None or not 1 <= side <= MOST_PIXELS:
                return None
            self._source.carry(_field(node, key), "pixels")
            sides.append(side)
        return sides[0], sides[1]

    def _region(self, node: Node, size: tuple[int, int] | None) -> Region | None:
        pixels = self._size(node) or size
        if pixels is None:
            self._source.drop(node, f"says no xResolution and yResolution from 1 to {MOST_PIXELS}")
            return None
        self._source.carry(_field(node, "id"), "id")
        if self._profile != "2d":
            for key in ("x", "y", "xsize", "ysize"):
                self._source.carry(_field(node, key), "where it is follows from its frustum or its points")
        name = _said(node, "id") or "region"
        fileset = self._filesets.get(name) or _first(node, "fileset")
        self._source.carry(None if fileset is None else _field(fileset, "region"), "which region has these files")
        return Region(node=node, name=name, pixels=pixels, fileset=fileset)

    def _draft(self, region: Region, left: float, metres: Float64) -> Draft | None:
        """The panel of a region; None where it cannot be shown, which is reported."""
        others: dict[str, Any] = {}
        eye, position = None, np.zeros(3)
        if self._profile == "a3":
            corners = self._lit(region, others)
        elif self._profile == "2d":
            corners = self._part(region, left, metres)
            self._warp(region, "geometryWarpFile", others)
        else:
            if self._profile == "sl":
                eye = position = self._position(region)
            corners = self._frustum(region, position)
            self._warp(region, "distortionMap" if eye is not None else "geometryWarpFile", others)
        if corners is None:
            return None
        self._mask(region, others)
        return Draft(
            node=region.node, name=region.name, pixels=region.pixels, corners=corners, eye=eye, others=others
        )  # fmt: skip

    def _part(self, region: Region, left: float, metres: Float64) -> Float64:
        """(3, 3) corners of a part of the flat image, which has its lower left corner at `left`, 0."""
        found = []
        for key, otherwise in (("x", 0.0), ("y", 0.0), ("xsize", 1.0), ("ysize", 1.0)):
            node = _field(region.node, key)
            value = self._source.number(node)
            right = value is not None and abs(value) <= 16.0 and (value > 0.0 or len(key) == 1)
            if right:
                self._source.carry(node, "corners")
            elif node is not None:
                self._source.drop(node, "is no part of the buffer: all of it instead")
            found.append(float(value) if right and value is not None else otherwise)
        x, y, width, height = found
        whole = metres if metres.all() else METRES_A_PIXEL * np.array(region.pixels) / (width, height)
        return upright(left + x * whole[0], y * whole[1], width * whole[0], height * whole[1])

    def _frustum(self, region: Region, position: Float64) -> Float64 | None:
        """(3, 3) corners of a panel that fills a region's frustum, at DISTANCE_M before `position`."""
        frustum = _first(region.node, "frustum")
        names = ("yaw", "pitch", "roll", "leftAngle", "rightAngle", "downAngle", "upAngle")
        values = [None if frustum is None else self._number(frustum, name) for name in names]
        if frustum is None or any(value is None for value in values):
            self._source.drop(frustum or region.node, f"a region needs a frustum with {', '.join(names)}")
            return None
        yaw, pitch, roll, *sides = (float(value or 0.0) for value in values)
        if max(map(abs, sides)) > WIDEST or sides[0] >= sides[1] or sides[2] >= sides[3]:
            self._source.drop(frustum, f"its sides are no growing angles of at most {WIDEST:g} degrees")
            return None
        low_x, high_x, low_y, high_y = (math.tan(math.radians(side)) for side in sides)
        local = np.array([[low_x, low_y, -1.0], [high_x, low_y, -1.0], [low_x, high_y, -1.0]])
        return np.asarray(position + DISTANCE_M * local @ turned(yaw, pitch, roll).T)

    def _axes(self, region: Region) -> Float64:
        """(3, 3) rows: right, up and backwards in the file's axes, which it tells as a pilot does: yaw's is down."""
        frame = _first(region.node, "coordinateFrame")
        if frame is None:
            return np.eye(3)
        rows = []
        for name, sign in (("pitch", 1.0), ("yaw", -1.0), ("roll", -1.0)):
            rows.append([sign * (self._number(frame, name + axis) or 0.0) for axis in "xyz"])
        axes = np.array(rows)
        if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-3):
            self._source.note(frame, "its axes are not at right angles: x is right, y up, z backwards instead")
            return np.eye(3)
        return axes

    def _position(self, region: Region) -> Float64:
        """(3,) metres, wall frame: where a shader lamp stands."""
        frame = _first(region.node, "coordinateFrame")
        place = [0.0 if frame is None else self._number(frame, "pos" + axis) or 0.0 for axis in "xyz"]
        return np.asarray(self._axes(region) @ np.array(place) * self._unit(region))

    def _unit(self, region: Region) -> float:
        """Metres of the file's unit."""
        warp = self._file(region, "geometryWarpFile")
        node = _child(warp, "geometricUnit") if warp is not None else None
        word = str(_text(node) or "").lower()
        if node is not None and word in METRES:
            self._source.carry(node, "metres")
        return METRES.get(word, 1.0)

    def _lit(self, region: Region, others: dict[str, Any]) -> Float64 | None:
        """(3, 3) corners of a panel through which the eye sees all that a region lights; its warp to `others`."""
        points = self._vectors(region, "geometryWarpFile")
        if points is None:
            self._source.drop(region.node, "the points that it lights are missing")
            return None
        points = points @ self._axes(region).T * self._unit(region)
        warp = self._file(region, "geometryWarpFile")
        origin = _child(warp, "originOf3DData") if warp is not None else None
        if (_text(origin) or "").lower() == "floorcenter":
            self._eye = np.array([0.0, EYE_HEIGHT_M, 0.0])
        self._source.carry(origin, "eye")
        away = points - self._eye
        length = np.linalg.norm(away, axis=2)
        known = np.isfinite(length) & (length > 0.0)
        if not known.any():
            self._source.drop(region.node, "lights nothing")
            return None
        normal = -(away[known] / length[known][:, None]).mean(axis=0)
        normal /= max(float(np.linalg.norm(normal)), 1e-9)
        depth = -(away @ normal)
        if (depth[known] < math.cos(math.radians(STEEPEST)) * length[known]).any():
            self._source.drop(region.node, f"is seen more than {STEEPEST:g} degrees from straight before it: too wide")
            return None
        across = _steps(away, 1)
        right = across - (across @ normal) * normal
        right /= max(float(np.linalg.norm(right)), 1e-9)
        up, near = np.cross(normal, right), float(depth[known].min())
        at = near * (away @ np.stack([right, up], axis=1)) / np.where(known, depth, np.nan)[..., None]
        low, high = at[known].min(axis=0), at[known].max(axis=0)
        size = np.maximum(high - low, 1e-3)
        others["warp"] = {"file": self._keep(region, "warp.npy", mpcdi_files.npy((at - low) / size * [1, -1] + [0, 1]))}
        corner = self._eye - near * normal + low[0] * right + low[1] * up
        self._source.note(region.node, "its points hold for an eye that stands: a tracked one sees what that eye saw")
        return np.array([corner, corner + size[0] * right, corner + size[1] * up])

    def _warp(self, region: Region, key: str, others: dict[str, Any]) -> None:
        """A region's warp as a table of positions."""
        if (vectors := self._vectors(region, key)) is None:
            return
        shares = vectors[..., :2] * [1.0, -1.0] + [0.0, 1.0]
        outside = (np.abs(shares - 0.5) > 0.5 + OUTSIDE).any(axis=2)
        shares[outside] = np.nan
        others["warp"] = {"file": self._keep(region, "warp.npy", mpcdi_files.npy(shares))}

    def _mask(self, region: Region, others: dict[str, Any]) -> None:
        """A region's alpha map."""
        node = self._file(region, "alphaMap")
        if node is None or (data := self._data(node)) is None:
            return
        gamma = self._number(node, "gammaEmbedded") or GAMMA
        try:
            made = mpcdi_files.mask(data, region.pixels, gamma)
        except ValueError as error:
            self._source.drop(node, str(error))
            return
        self._source.carry(node, "blend_mask")
        others["blend_mask"] = self._keep(region, "mask.png", made)

    def _vectors(self, region: Region, key: str) -> Float64 | None:
        """(h, w, 3) of each pixel of a region; None where the file is missing or wrong, which is reported."""
        node = self._file(region, key)
        if node is None or (data := self._data(node)) is None:
            return None
        try:
            found = mpcdi_files.read_pfm(data, region.pixels)
        except ValueError as error:
            self._source.drop(node, str(error))
            return None
        for key in ("path", "interpolation"):
            self._source.carry(_child(node, key), "warp")
        return found

    def _data(self, node: Node) -> bytes | None:
        """The bytes of the file that an element names."""
        path = _text(_child(node, "path"))
        if not path:
            return None
        try:
            data = None if self._files is None else self._files.read(path)
        except ConfigError as error:
            self._source.drop(node, str(error))
            return None
        if data is None:
            self._source.drop(node, "its file is not there")
        return data

    def _file(self, region: Region, key: str) -> Node | None:
        return None if region.fileset is None else _child(region.fileset, key)

    def _keep(self, region: Region, what: str, data: bytes) -> str:
        """Add a file to the conversion. Returns its path beside the YAML."""
        plain = "".join(ch if ch.isascii() and (ch.isalnum() or ch in "-_") else "-" for ch in region.name)[:48]
        folder = "" if self._files is None else self._files.folder
        path = f"{folder}/{len(self._made)}-{plain}.{what}" if folder else f"{plain}.{what}"
        self._made[path] = data
        return path

    def _number(self, parent: Node, key: str) -> float | None:
        """The number that a child element holds."""
        node = _child(parent, key)
        text = None if node is None else node.get("#text")
        found = self._source.number(text)
        if found is not None:
            self._source.carry(node, "corners")
        return found


def _steps(points: Float64, axis: int) -> Float64:
    """(3,) the mean step from one pixel to the next, as far as they are known."""
    steps = np.diff(points, axis=axis).reshape(-1, 3)
    known = np.isfinite(steps).all(axis=1)
    return np.asarray(steps[known].mean(axis=0)) if known.any() else np.array([1.0, 0.0, 0.0])


def _all(node: Node, tag: str) -> list[Node]:
    """Elements of a tag inside a node, in order; names are read in any case, as files have them."""
    found = []
    for item in node.items:
        found += [item] if item.key.lower() == tag.lower() else _all(item, tag)
    return found


def _first(node: Node, tag: str) -> Node | None:
    return next(iter(_all(node, tag)), None)


def _child(node: Node, tag: str) -> Node | None:
    return next((item for item in node.items if item.key.lower() == tag.lower()), None)


def _field(node: Node, key: str) -> Node | None:
    return next((field for name, field in node.fields.items() if name.lower() == key.lower()), None)


def _said(node: Node, key: str) -> str:
    field = _field(node, key)
    return "" if field is None else str(field.value).strip()


def _text(node: Node | None) -> str | None:
    text = None if node is None else node.get("#text")
    return None if text is None else str(text.value).strip()
