"""Points from files as columns of numbers: .ply, .npy, .npz, .csv, .txt and .xyz.

Each format gives columns by name, and those without names by number. Nothing is unpickled. Raises SceneError.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.errors import SceneError
from wall.scene.data.errors import parser_says
from wall.scene.data.samples import CURVES, POINT_STEPS, POINTS

MOST_NAMED = 30  # in an error
FIRST_ROWS = 4096  # bytes of a text file in which its first row of numbers is looked for
POSITIONS = ("x", "y", "z")
WHOLE_POSITIONS = ("position", "positions", "points", "xyz", "coordinates", "pos")  # arrays (n, 3)
CURVE = "curve"  # column of the number of the curve that a point is of
COLORS = ("red", "green", "blue")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns of equal length, in the order of the file."""

    path: Path
    columns: dict[str, NDArray[Any]]  # (n,) each; a column without a name is called by its number
    starts: NDArray[np.bool_] | None = None  # (n,) of curves: where each begins

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def column(self, wanted: str | int, where: str) -> NDArray[Any]:
        """(n,) numbers of a column by name, or by number from 0; `where`: in the configuration, for the error."""
        names = list(self.columns)
        if isinstance(wanted, int) and wanted < len(names):
            return self.columns[names[wanted]]
        if str(wanted) in self.columns:
            return self.columns[str(wanted)]
        near = get_close_matches(str(wanted), names, n=1)
        meant = f"did you mean {near[0]!r}? " if near else ""
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        raise SceneError(
            f"{where} = {wanted!r}: {self.path.name} has no such column; {meant}"
            f"there are {', '.join(names[:MOST_NAMED])}{more}"
        )

    @property
    def position_columns(self) -> tuple[str, ...]:
        """The columns of the coordinates: x, y, z, or an array of positions, or the first three."""
        if set(POSITIONS) <= set(self.columns):
            return POSITIONS
        for name in WHOLE_POSITIONS:
            if (parts := tuple(f"{name}.{axis}" for axis in range(3)))[0] in self.columns:
                return parts
        return tuple(self.columns)[:3]


def read_table(path: Path, row: int | None = None) -> Table:
    """The columns of a file of points, or of built-in ones by their name.

    row : of the first axis of an array, or the step of a built-in series; None: it has no steps
    """
    if path.name in POINT_STEPS:
        return Table(path=path, columns=POINT_STEPS[path.name](row or 0))
    if path.name in POINTS:
        return Table(path=path, columns=POINTS[path.name]())
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = f"{', '.join(READERS)}, and built in {', '.join([*POINTS, *POINT_STEPS])}"
        raise SceneError(f"{path}: no known kind of points, known are {known}")
    if not path.is_file():
        raise SceneError(f"{path}: there is no such file")
    try:
        columns = reader(path) if row is None else _named("", np.load(path, mmap_mode="r", allow_pickle=False)[row])
    except SceneError:
        raise
    except Exception as error:  # parsers of broken files raise anything
        raise SceneError(f"{path}: cannot be read as {path.suffix.lower()[1:]}, {parser_says(error)}") from error
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{name}: {count}" for name, count in list(lengths.items())[:MOST_NAMED])
        raise SceneError(f"{path}: its columns are of different lengths ({told}); wanted one row for each point")
    if len(columns) < 3:
        raise SceneError(f"{path}: has the columns {', '.join(columns)}; wanted at least three, for coordinates")
    return Table(path=path, columns=columns)


def read_curves(path: Path) -> Table:
    """The points of a file's curves, one after the other: of VTK's lines, of an array, or of tables with a `curve`."""
    suffix = path.suffix.lower()
    if path.name in CURVES:
        table = Table(path=path, columns=CURVES[path.name]())
    elif suffix in (".vtp", ".vtk", ".vtu"):
        from wall.scene.data.vtk_files import read_lines

        columns, curve = read_lines(path)
        table = Table(path=path, columns=columns | {CURVE: curve})
    elif suffix == ".npy" and (rows := _three_axes(path)) is not None:
        count, points, width = rows.shape
        flat = {str(k): rows[:, :, k].ravel() for k in range(width)}
        table = Table(path=path, columns=flat | {CURVE: np.repeat(np.arange(count), points)})
    else:
        table = read_table(path)
    if CURVE not in table.columns or len(table.columns) < 4 or len(table) == 0:
        came = ", ".join(list(table.columns)[:MOST_NAMED])
        raise SceneError(
            f"{path}: has the columns {came}; wanted coordinates and {CURVE!r}, the number of each one's curve"
        )
    curve = table.columns.pop(CURVE)
    starts = np.ones(len(curve), np.bool_)
    starts[1:] = curve[1:] != curve[:-1]
    return Table(path=path, columns=table.columns, starts=starts)


def _three_axes(path: Path) -> NDArray[Any] | None:
    """An array of three axes; None for others, and for files that cannot be read, which is said elsewhere."""
    try:
        found: NDArray[Any] = np.load(path, allow_pickle=False)
    except (OSError, ValueError):
        return None
    return found if found.ndim == 3 and found.dtype.names is None else None


def _named(name: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """The columns of an array of points: of its fields, or of its second axis."""
    prefix = f"{name}." if name else ""
    if values.dtype.names is not None:
        fields = {field: np.ravel(values)[field] for field in values.dtype.names}
        return {key: column for field, rows in fields.items() for key, column in _named(prefix + field, rows).items()}
    if not np.issubdtype(values.dtype, np.number) and values.dtype != np.bool_:
        raise ValueError(f"array {name!r} holds {values.dtype}, wanted numbers")
    if values.ndim == 1:
        return {name or "0": values}
    if values.ndim != 2:
        raise ValueError(f"array {name!r} is {'x'.join(map(str, values.shape))}, wanted a row for each point")
    return {f"{prefix}{k}": values[:, k] for k in range(values.shape[1])}


def _from_npy(path: Path) -> dict[str, NDArray[Any]]:
    return _named("", np.load(path, allow_pickle=False))


def _from_npz(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays with a row for each point; others, such as the time of a step, are left out."""
    with np.load(path, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    count = max((len(values) for values in arrays.values() if values.ndim), default=0)
    kept = {name: values for name, values in arrays.items() if values.ndim and len(values) == count}
    return {key: column for name, values in kept.items() for key, column in _named(name, values).items()}


def _from_ply(path: Path) -> dict[str, NDArray[Any]]:
    """The properties of a PLY's vertices, whether it has faces or not."""
    import trimesh  # 0.3 s, that other formats do not wait for

    with np.errstate(all="ignore"):
        loaded = trimesh.load(path, process=False, force=None)
    parts = list(loaded.geometry.values()) if hasattr(loaded, "geometry") else [loaded]
    data = parts[0].metadata["_ply_raw"]["vertex"]["data"]
    if isinstance(data, dict):
        return {name: np.ravel(values) for name, values in data.items()}
    return {name: np.ravel(data[name]) for name in data.dtype.names}


def _from_text(path: Path) -> dict[str, NDArray[Any]]:
    """Rows of numbers, apart by commas, semicolons, tabs or spaces, behind a row of names or none."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        head = file.read(FIRST_ROWS)
    rows = head.splitlines()
    first = next((k for k, row in enumerate(rows) if _numbers(row) is not None), None)
    if first is None:
        raise ValueError("no row of numbers near its beginning")
    mark = next((mark for mark in ",;\t" if mark in rows[first]), None)
    before = [row for row in rows[:first] if row.strip(" \t#/")]
    names = _split(before[-1].strip().lstrip("#/"), mark) if before else []
    values = np.loadtxt(path, delimiter=mark, comments=("#", "//"), skiprows=first, ndmin=2, encoding="utf-8-sig")
    if len(names) != values.shape[1]:
        names = [str(k) for k in range(values.shape[1])]
    return dict(zip(names, values.T, strict=True))


def _numbers(row: str) -> list[float] | None:
    """The numbers of a row; None where it has anything else, or fewer than three."""
    try:
        found = [float(word) for word in row.replace(",", " ").replace(";", " ").split()]
    except ValueError:
        return None
    return found if len(found) >= 3 else None


def _split(row: str, mark: str | None) -> list[str]:
    words: Sequence[str] = row.split(mark)
    return [word.strip().strip("\"'") for word in words]


READERS: dict[str, Callable[[Path], dict[str, NDArray[Any]]]] = {
    ".ply": _from_ply,
    ".npy": _from_npy,
    ".npz": _from_npz,
    ".csv": _from_text,
    ".txt": _from_text,
    ".xyz": _from_text,
}
