"""`warp`: a picture bent by a mesh, for curved screens and projectors that stand askew."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError

from wall.core.data import Float64, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import Model, Number, Text, Whole, refusal
from wall.operators.base import Input, Operator
from wall.operators.kernels import resample as kernels
from wall.operators.parts import blank, later, part

Nodes = Annotated[Whole, Ge(2), Le(1024)]
Share = Annotated[Number, Ge(-4.0), Le(5.0)]  # four pictures beyond the display: farther is a typing error
Points = Annotated[tuple[tuple[Share, Share], ...], Field(min_length=4, max_length=65536)]


class Mesh(Model):
    """Where the nodes of a regular grid over the picture go."""

    columns: Nodes = Field(description="nodes side by side, the picture's edges among them")
    rows: Nodes = Field(description="nodes on top of each other")
    points: Points = Field(description="[x, y] of each node, 0..1 from the top left, row by row from the top")

    @model_validator(mode="after")
    def _one_point_a_node(self) -> Mesh:
        if len(self.points) != self.columns * self.rows:
            came = f"{len(self.points)} points for {self.columns} x {self.rows} nodes"
            raise refusal(came, accepted=f"{self.columns * self.rows} points", at=("points",))
        return self


class Bent:
    """A mesh and the look-up tables made of it, one for each size of picture that came."""

    def __init__(self, mesh: Mesh) -> None:
        self._points: Float64 = np.array(mesh.points, np.float64).reshape(mesh.rows, mesh.columns, 2)
        self._tables: dict[tuple[int, int], NDArray[np.int32]] = {}

    def table(self, rect: Rect) -> NDArray[np.int32]:
        """(h, w, 2) int32: the place in the picture of each pixel, see kernels_sampling.look_up_bilinear."""
        size = (rect.height, rect.width)
        if size not in self._tables:
            places = np.empty((*size, 2), np.int32)
            kernels.rasterise_mesh(self._points * (rect.width, rect.height), places)
            self._tables[size] = places
        return self._tables[size]

    def touched(self, rect: Rect, whole: Rect) -> Rect:
        """Where a part of the picture goes: the box around its cells' nodes, for no cell bulges out of those."""
        rows, columns = (n - 1 for n in self._points.shape[:2])
        left, right = _cells(rect.x - whole.x, rect.right - whole.x, whole.width, columns)
        top, bottom = _cells(rect.y - whole.y, rect.bottom - whole.y, whole.height, rows)
        nodes = self._points[top : bottom + 1, left : right + 1].reshape(-1, 2) * (whole.width, whole.height)
        low, high = np.floor(nodes.min(axis=0)).astype(int) - 1, np.ceil(nodes.max(axis=0)).astype(int) + 1
        x, y = whole.x + int(low[0]), whole.y + int(low[1])
        return Rect(x=x, y=y, width=int(high[0] - low[0]), height=int(high[1] - low[1]))


class Warp(Operator):
    """As large as the input. Pixels that the mesh does not reach are blank.

    Between nodes places are bilinear. Colour, alpha and variance are mixed of the four pixels around a place that is
    known to 1/4096 pixel; depth, time and object are those of the nearest. A mesh that changes nothing changes no bit.
    Where it shrinks the picture much below half, detail may alias: scale it first.
    """

    op: Literal["warp"] = Field(description="bent by a mesh")
    input: Input
    mesh: Mesh | None = Field(default=None, description="where the picture's places go")
    file: Text | None = Field(default=None, description="YAML or JSON with columns, rows and points, instead of a mesh")

    KEEPS_RAYS: ClassVar[bool] = False

    @model_validator(mode="after")
    def _mesh_or_file(self) -> Warp:
        if (self.mesh is None) == (self.file is None):
            raise refusal("needs either a mesh or a file", accepted="mesh: {columns, rows, points} or file: NAME")
        return self

    @cached_property
    def _bent(self) -> Bent | None:
        return Bent(self.mesh) if self.mesh is not None else None

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        return self._bent.touched(rect, inputs[0]) if self._bent is not None else inputs[0]

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> Bent:
        return self._bent or Bent(read_mesh(folder / str(self.file)))

    def apply(self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: Bent) -> None:
        source = inputs[0]
        places = np.ascontiguousarray(prepared.table(source.rect)[region.inside(out.rect)])
        blank(out, region)
        for name in out.channels & {"colour", "alpha", "variance"}:
            values, here = source.channel(name), part(out, name, region)
            warped = here[..., None].copy() if values.ndim == 2 else here.copy()
            planes = values[..., None] if values.ndim == 2 else values
            kernels.look_up_bilinear(planes, places, name == "variance", warped)
            here[...] = warped.reshape(here.shape)
        inside = places[..., 0] != kernels.NOWHERE
        size = (source.rect.width, source.rect.height)
        x, y = (np.clip((places[..., c] + kernels.PLACE // 2) // kernels.PLACE, 0, size[c] - 1) for c in range(2))
        for name in out.channels & {"depth", "time", "object_id"}:
            nearest = source.channel(name)[y, x]
            np.copyto(
                part(out, name, region), nearest + later(source, out) if name == "time" else nearest, where=inside
            )


def read_mesh(path: Path) -> Mesh:
    """Read a mesh of YAML or JSON. Raises ConfigError naming the file, and the line where its syntax is wrong."""
    try:
        values: Any = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read, {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not text, wanted YAML with columns, rows and points") from error
    except MarkedYAMLError as error:
        line = f":{error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigError(f"{path}{line}: {error.problem}") from error
    try:
        return Mesh.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"])) or "the mesh"
        raise ConfigError(f"{path}: {place}: {first['msg']}, wanted columns, rows and one [x, y] a node") from error


def _cells(start: int, end: int, size: int, count: int) -> tuple[int, int]:
    """First node and last of the cells that take from pixels from `start` to before `end`."""
    low, high = (start - 1) / size * count, (end + 1) / size * count
    return max(0, math.floor(low)), min(count, math.ceil(high))
