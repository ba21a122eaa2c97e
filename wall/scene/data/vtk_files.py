"""Surfaces and fields from files, through VTK: the only file that touches it.

VTK comes with the extra wall[data]; it reads every version of its formats, finds outer faces of cells of any kind, and
contours fields on any grid. Raises SceneError.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float32, Float64
from wall.core.errors import SceneError
from wall.core.files import open_file
from wall.scene.data.errors import NoSurfaceError
from wall.scene.data.samples import FIELDS

READERS = {  # by VTK's module and class
    ".vtp": ("vtkIOXML", "vtkXMLPolyDataReader"),
    ".vtu": ("vtkIOXML", "vtkXMLUnstructuredGridReader"),
    ".vti": ("vtkIOXML", "vtkXMLImageDataReader"),
    ".vts": ("vtkIOXML", "vtkXMLStructuredGridReader"),
    ".vtr": ("vtkIOXML", "vtkXMLRectilinearGridReader"),
    ".vtk": ("vtkIOLegacy", "vtkDataSetReader"),
    ".mha": ("vtkIOImage", "vtkMetaImageReader"),
    ".mhd": ("vtkIOImage", "vtkMetaImageReader"),
}
LONGEST_HEADER = 1 << 16  # bytes of an .mhd
LONGEST_REASON = 200  # characters of VTK's errors


@dataclass(frozen=True, slots=True, kw_only=True)
class Field:
    """Numbers of an array: one for each point, or for each triangle."""

    values: Float64  # (v,) or (t,)
    of_points: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """Triangles as VTK has them."""

    vertices: Float64  # (v, 3)
    triangles: NDArray[np.int64]  # (t, 3)
    normals: Float64 | None  # (v, 3)
    field: Field | None


def read_data_set(path: Path) -> Any:
    """VTK's data set of a file, or of a built-in field by its name."""
    if path.name in FIELDS:
        return _image(*FIELDS[path.name](), path)
    kind = READERS.get(path.suffix.lower())
    if kind is None:
        known = f"{', '.join(READERS)}, and built in {', '.join(FIELDS)}"
        raise SceneError(f"{path}: no known kind of surface or field, known are {known}")
    if not path.is_file():
        raise SceneError(f"{path}: there is no such file")
    if path.suffix.lower() == ".mhd":
        _check_named(path)
    reader = _made(*kind, path)
    reader.SetFileName(str(path))
    if path.suffix.lower() == ".vtk":  # else it reads one array of each kind
        reader.ReadAllScalarsOn()
        reader.ReadAllVectorsOn()
        reader.ReadAllFieldsOn()
    found = _updated(reader, path)
    if found is None or found.GetNumberOfPoints() == 0:
        raise SceneError(f"{path}: holds no points")
    return found


def _check_named(path: Path) -> None:
    """Refuse a header whose numbers are in a pipe or a device, for which VTK would wait."""
    try:
        with open_file(path) as file:
            header = file.read(LONGEST_HEADER).decode("utf-8-sig", "replace")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read, {error.strerror or error}") from error
    for name in files_of_header(header):
        if (named := path.parent / name).exists() and not named.is_file():
            raise SceneError(f"{path}: names {named}, which is a pipe, a device or a folder; wanted a file")


def files_of_header(text: str) -> list[str]:
    """The names of the files that hold the numbers of an .mhd, which ends with them; [] where it holds them itself."""
    found = re.search(r"^ElementDataFile\s*=\s*(\S.*?)\s*$(.*)", text, re.MULTILINE | re.DOTALL)
    if found is None or found[1] == "LOCAL":
        return []
    listed = found[1].startswith("LIST")
    return [line.strip() for line in found[2].splitlines() if line.strip()] if listed else [found[1]]


def read_lines(path: Path) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """The points of a file's lines, line after line: x, y, z and its arrays as columns, and the number of each line.

    A vector is columns by `name.0`, ..., and its length by name. Arrays of cells are those of lines.
    """
    found = read_data_set(path)
    if not found.IsA("vtkPolyData"):
        faces = _made("vtkFiltersGeometry", "vtkDataSetSurfaceFilter", path)
        faces.SetInputData(found)
        found = _updated(faces, path)
    lines = found.GetLines()
    if lines.GetNumberOfCells() == 0:
        raise SceneError(f"{path}: holds no lines; wanted polylines, or type: points or surface")
    corners = _numbers(lines.GetConnectivityArray()).astype(np.intp)
    line = np.repeat(np.arange(lines.GetNumberOfCells()), np.diff(_numbers(lines.GetOffsetsArray())))
    columns = dict(zip("xyz", np.asarray(_numbers(found.GetPoints().GetData()), np.float64)[corners].T, strict=True))
    of_cell = line + found.GetNumberOfVerts()  # cells of vertices come first
    for arrays, rows in ((found.GetPointData(), corners), (found.GetCellData(), of_cell)):
        for name in _names(arrays):
            values = np.asarray(_numbers(arrays.GetArray(name)), np.float64)[rows]
            if values.ndim == 2:
                columns |= {f"{name}.{k}": values[:, k] for k in range(values.shape[1])}
                values = np.linalg.norm(values, axis=1)
            columns.setdefault(name, values)
    return columns, line


def _image(arrays: dict[str, Float32], spacing: float, path: Path) -> Any:
    """VTK's image of arrays (z, y, x) about the origin."""
    image = _made("vtkCommonDataModel", "vtkImageData", path)
    sizes = next(iter(arrays.values())).shape[::-1]
    image.SetDimensions(*sizes)
    image.SetSpacing(spacing, spacing, spacing)
    image.SetOrigin(*(-spacing * (size - 1) / 2.0 for size in sizes))
    for name, values in arrays.items():
        _add_array(image, name, values.ravel())
    return image


def _add_array(data_set: Any, name: str, values: NDArray[Any]) -> None:
    """Give a data set an array of points: a copy of `values`, a number each."""
    array = import_module("vtkmodules.util.numpy_support").numpy_to_vtk(values, deep=True)
    array.SetName(name)
    data_set.GetPointData().AddArray(array)


def outer_surface(data_set: Any, array: str | None, path: Path, where: str) -> Surface:
    """Polygons of a data set, or the outer faces of its cells, with the numbers of an array.

    array : of points or cells, None: none; where : it is named in the configuration, for errors
    """
    chosen = None if array is None else _array(data_set, array, path, where)
    faces = _made("vtkFiltersGeometry", "vtkDataSetSurfaceFilter", path)
    faces.SetInputData(data_set)
    return _triangulated(_updated(faces, path), chosen, path)


def isosurface(
    data_set: Any, value: float, *, array: str | None, color_array: str | None, path: Path, where: str
) -> Surface:
    """Where an array of a data set has a value, with the numbers of another one; of cells, means at points are taken,
    of vectors lengths.

    array : None: its only one; where : of the entry in the configuration, for errors
    """
    if data_set.IsA("vtkPolyData"):
        raise SceneError(f"{where}: {path.name} holds surfaces, lines or points; wanted: cells in space")
    name, of_points = _array(data_set, array or _only_array(data_set, path, where), path, f"{where}.array")
    chosen = None if color_array is None else _array(data_set, color_array, path, f"{where}.color_by.array")
    if not of_points or (chosen is not None and not chosen[1]):
        means = _made("vtkFiltersCore", "vtkCellDataToPointData", path)
        means.SetInputData(data_set)
        data_set = _updated(means, path)
        chosen = chosen and (chosen[0], True)
    if data_set.GetPointData().GetArray(name).GetNumberOfComponents() > 1:
        data_set, name = _with_lengths(data_set, name)
    low, high = data_set.GetPointData().GetArray(name).GetRange()
    contour = _made("vtkFiltersCore", "vtkContourFilter", path)
    contour.SetInputData(data_set)
    contour.SetInputArrayToProcess(0, 0, 0, 0, name)
    contour.SetValue(0, value)
    found = _triangulated(_updated(contour, path), chosen, path)
    if len(found.triangles) == 0:
        raise NoSurfaceError(
            f"{where}.value = {value:g}: {name!r} of {path.name} is from {low:g} to {high:g}, never that"
        )
    return found


def _with_lengths(data_set: Any, name: str) -> tuple[Any, str]:
    """A data set that has the lengths of an array of points' vectors too, and what they are called."""
    vectors = np.asarray(_numbers(data_set.GetPointData().GetArray(name)), np.float64)
    with_lengths, lengths = data_set.NewInstance(), f"length of {name}"
    with_lengths.ShallowCopy(data_set)
    _add_array(with_lengths, lengths, np.linalg.norm(vectors, axis=1))
    return with_lengths, lengths


def _triangulated(polygons: Any, chosen: tuple[str, bool] | None, path: Path) -> Surface:
    filter_ = _made("vtkFiltersCore", "vtkTriangleFilter", path)
    filter_.SetInputData(polygons)
    filter_.PassVertsOff()
    filter_.PassLinesOff()
    triangles = _updated(filter_, path)
    points = triangles.GetPoints()
    vertices = np.zeros((0, 3)) if points is None else np.array(_numbers(points.GetData()), np.float64)
    corners = _numbers(triangles.GetPolys().GetConnectivityArray()).astype(np.int64)
    normals = triangles.GetPointData().GetNormals()
    field = None
    if chosen is not None:
        of = triangles.GetPointData() if chosen[1] else triangles.GetCellData()
        values = np.array(_numbers(of.GetArray(chosen[0])), np.float64)
        field = Field(values=values if values.ndim == 1 else np.linalg.norm(values, axis=1), of_points=chosen[1])
    return Surface(
        vertices=vertices,
        triangles=corners.reshape(-1, 3),
        normals=None if normals is None else np.array(_numbers(normals), np.float64),
        field=field,
    )


def _numbers(array: Any) -> NDArray[Any]:
    """The numbers of VTK's array, which keeps them."""
    found: NDArray[Any] = import_module("vtkmodules.util.numpy_support").vtk_to_numpy(array)
    return found


def _array(data_set: Any, name: str, path: Path, where: str) -> tuple[str, bool]:
    """An array's name, and whether it is of points."""
    for of_points, arrays in ((True, data_set.GetPointData()), (False, data_set.GetCellData())):
        if name in _names(arrays):
            return name, of_points
    raise SceneError(f"{where} = {name!r}: {path.name} has no such array of numbers; {_described(data_set)}")


def _only_array(data_set: Any, path: Path, where: str) -> str:
    names = [*_names(data_set.GetPointData()), *_names(data_set.GetCellData())]
    if len(names) != 1:
        raise SceneError(
            f"{where}.array: {path.name} has {len(names)} arrays, wanted the name of one; {_described(data_set)}"
        )
    return names[0]


def _described(data_set: Any) -> str:
    points, cells = _names(data_set.GetPointData()), _names(data_set.GetCellData())
    return f"there are {', '.join(points) or 'none'} of points and {', '.join(cells) or 'none'} of cells"


def _names(arrays: Any) -> list[str]:
    """The arrays of numbers; texts have no place here."""
    found = (arrays.GetArray(k) for k in range(arrays.GetNumberOfArrays()))
    return [array.GetName() for array in found if array is not None and array.GetName()]


def _made(module: str, kind: str, path: Path) -> Any:
    """A VTK object of a class."""
    try:
        logger = import_module("vtkmodules.vtkCommonCore").vtkLogger
        logger.SetStderrVerbosity(logger.VERBOSITY_OFF)  # errors are raised here
        return getattr(import_module(f"vtkmodules.{module}"), kind)()
    except ImportError as error:
        raise SceneError(f"{path}: needs VTK, which cannot be loaded ({error}): pip install 'wall[data]'") from None


def _updated(algorithm: Any, path: Path) -> Any:
    """What a VTK object makes; its errors, which it would print, become a SceneError."""
    said: list[str] = []

    def hear(_object: Any, _event: str, text: str) -> None:
        said.append(" ".join((text or "in words that are no UTF-8").split()))

    hear.CallDataType = "string0"  # type: ignore[attr-defined]
    algorithm.AddObserver("ErrorEvent", hear)
    executive = algorithm.GetExecutive()
    if executive is not None:
        executive.AddObserver("ErrorEvent", hear)
    algorithm.Update()
    if said:
        raise SceneError(f"{path}: VTK cannot read it: {_reason(said[0])}")
    return algorithm.GetOutput()


def _reason(text: str) -> str:
    """VTK's error without where it stands in VTK's sources."""
    return text.rpartition("): ")[2][:LONGEST_REASON]
