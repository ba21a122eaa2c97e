"""`warp`: an image deformed by a mesh, for curved screens and oblique projectors."""

from __future__ import annotations

import io
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
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from wall.core.data import Float64, Framelet, Rect
from wall.core.errors import ConfigError
from wall.core.fields import Model, Number, Text, Whole, refusal
from wall.core.files import read_file
from wall.operators.base import Input, Operator
from wall.operators.bounded_yaml import BoundedComposer
from wall.operators.kernels import resample as kernels
from wall.operators.regions import look_up

MOST_BYTES = 1 << 23  # of a file: 65,536 points of 128 characters
HEADER_BYTES = 1 << 12  # of a .npy file before its numbers, at most
Nodes = Annotated[Whole, Ge(2), Le(1024)]
Share = Annotated[Number, Ge(-4.0), Le(5.0)]  # four images beyond the display: farther is a typing error
Points = Annotated[tuple[tuple[Share, Share], ...], Field(min_length=4, max_length=65536)]


class Mesh(Model):
    """The position on the display of each node of a regular grid over the image."""

    columns: Nodes = Field(description="nodes side by side, the image's edges among them")
    rows: Nodes = Field(description="nodes on top of each other")
    points: Points = Field(description="[x, y] of each node, 0..1 from the top left, row by row from the top")

    @model_validator(mode="after")
    def _one_point_a_node(self) -> Mesh:
        if len(self.points) != self.columns * self.rows:
            came = f"{len(self.points)} points for {self.columns} x {self.rows} nodes"
            raise refusal(came, accepted=f"{self.columns * self.rows} points", at=("points",))
        return self


class WarpTables:
    """The look-up tables of a mesh, one for each image size that came."""

    def __init__(self, mesh: Mesh) -> None:
        self._points: Float64 = np.array(mesh.points, np.float64).reshape(mesh.rows, mesh.columns, 2)
        self._tables: dict[tuple[int, int], NDArray[np.int32]] = {}

    def table(self, rect: Rect) -> NDArray[np.int32]:
        """(h, w, 2) int32: the position in the image of each display pixel, see kernels.look_up_bilinear."""
        size = (rect.height, rect.width)
        if size not in self._tables:
            self._tables[size] = positions = np.empty((*size, 2), np.int32)
            kernels.rasterise_mesh(self._points * (rect.width, rect.height), positions)
        return self._tables[size]

    def touched(self, rect: Rect, whole: Rect) -> Rect:
        """The display pixels that show a part of the image: the box around its cells' nodes, which holds the cells."""
        rows, columns = (n - 1 for n in self._points.shape[:2])
        left, right = _cells(rect.x - whole.x, rect.right - whole.x, whole.width, columns)
        top, bottom = _cells(rect.y - whole.y, rect.bottom - whole.y, whole.height, rows)
        nodes = self._points[top : bottom + 1, left : right + 1].reshape(-1, 2) * (whole.width, whole.height)
        low, high = np.floor(nodes.min(axis=0)).astype(int) - 1, np.ceil(nodes.max(axis=0)).astype(int) + 1
        x, y = whole.x + int(low[0]), whole.y + int(low[1])
        return Rect(x=x, y=y, width=int(high[0] - low[0]), height=int(high[1] - low[1]))


class PositionTable:
    """Where each display pixel is in the image, read from a file: shares of it, NaN where nothing is shown."""

    def __init__(self, path: Path, rect: Rect) -> None:
        """`rect`: of the image. Raises ConfigError naming the file."""
        shares = read_positions(path, (rect.width, rect.height))
        pixels = shares * np.array([rect.width, rect.height]) - 0.5
        known = np.isfinite(pixels).all(axis=2, keepdims=True)
        with np.errstate(invalid="ignore"):
            steps = np.floor(np.clip(pixels, -kernels.FARTHEST, kernels.FARTHEST) * kernels.SUBPIXELS + 0.5)
        self._table = np.where(known, steps, kernels.NOWHERE).astype(np.int32)

    def table(self, rect: Rect) -> NDArray[np.int32]:
        """(h, w, 2) int32, see kernels.look_up_bilinear."""
        return self._table


class Warp(Operator):
    """As large as the input. Pixels that the mesh does not reach are blank.

    Between nodes positions are bilinear. Colour, alpha and variance are interpolated between the four pixels around a
    position, which is known to 1/4096 pixel; depth, time and object are those of the nearest. The identity changes no
    bit. Where the mesh shrinks the image much below half, detail may alias: scale it first.
    """

    op: Literal["warp"] = Field(description="deformed by a mesh")
    input: Input
    mesh: Mesh | None = Field(default=None, description="grid of display positions")
    file: Text | None = Field(
        default=None,
        description="instead of a mesh: YAML or JSON with columns, rows and points; or .npy, (h, w, 2) numbers: for "
        "each display pixel its position in the image, 0..1 from the top left",
    )

    ONE_OF: ClassVar[tuple[str, str, str] | None] = ("mesh", "file", "mesh: {columns, rows, points} or file: NAME")
    KEEPS_RAYS: ClassVar[bool] = False

    @cached_property
    def _tables(self) -> WarpTables | None:
        return WarpTables(self.mesh) if self.mesh is not None else None

    def touched(self, rect: Rect, inputs: Sequence[Rect], k: int) -> Rect:
        """The display pixels that show `rect`; all of them for a file, which is not read yet."""
        return self._tables.touched(rect, inputs[0]) if self._tables is not None else inputs[0]

    def prepare(self, folder: Path, inputs: Sequence[Rect]) -> WarpTables | PositionTable:
        """The tables of the mesh, or what the file says. Raises ConfigError."""
        if self._tables is not None:
            return self._tables
        path = folder / str(self.file)
        return PositionTable(path, inputs[0]) if path.suffix == ".npy" else WarpTables(read_mesh(path))

    def apply(
        self, inputs: Sequence[Framelet], out: Framelet, region: Rect, prepared: WarpTables | PositionTable
    ) -> None:
        """Write the warped pixels of a region."""
        look_up(inputs[0], out, region, prepared.table(inputs[0].rect)[region.inside(out.rect)])


def read_mesh(path: Path) -> Mesh:
    """Read a mesh of YAML or JSON. Raises ConfigError naming the file, and the line where its syntax is wrong."""
    try:
        yaml = YAML(typ="safe", pure=True)
        yaml.Composer = BoundedComposer
        values: Any = yaml.load(read_file(path, MOST_BYTES).decode("utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read, {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not text, wanted YAML with columns, rows and points") from error
    except MarkedYAMLError as error:
        line = f":{error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigError(f"{path}{line}: {error.problem}") from error
    except (YAMLError, RecursionError, ValueError, AttributeError, KeyError, AssertionError) as error:
        # the library leaks such errors for some malformed directives, and where lists are nested too deeply
        problem = "lists are nested too deeply" if isinstance(error, RecursionError) else "it is no valid YAML"
        raise ConfigError(f"{path}: {problem}, wanted columns, rows and points") from error
    try:
        return Mesh.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "the mesh"
        raise ConfigError(f"{path}: {where}: {first['msg']}, wanted columns, rows and one [x, y] a node") from error


def read_positions(path: Path, size: tuple[int, int]) -> Float64:
    """(h, w, 2) float64 of a .npy file for an image of `size`, width and height. Raises ConfigError naming the file."""
    width, height = size
    wanted = f"({height}, {width}, 2) floating-point numbers: x and y, 0 to 1, for each pixel"
    try:
        data = io.BytesIO(read_file(path, HEADER_BYTES + 16 * width * height))
        found = np.load(data, allow_pickle=False)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read, {error.strerror or error}; wanted {wanted}") from error
    except (ValueError, EOFError) as error:
        raise ConfigError(f"{path}: is no .npy file that can be read ({error}); wanted {wanted}") from error
    if found.shape != (height, width, 2) or found.dtype.kind != "f":
        raise ConfigError(f"{path}: is {found.shape} of {found.dtype}, wanted {wanted}")
    positions: Float64 = found.astype(np.float64)
    return positions


def _cells(start: int, end: int, size: int, count: int) -> tuple[int, int]:
    """First node and last of the cells that take from pixels from `start` to before `end`."""
    low, high = (start - 1) / size * count, (end + 1) / size * count
    return max(0, math.floor(low)), min(count, math.ceil(high))
