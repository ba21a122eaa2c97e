"""The files, or parts of files, that the steps of a series are in, and when each of them is shown.

A pattern with one *, a .pvd or .series file of ParaView's, a .npy whose first axis is time, or a built-in name.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from wall.config.scene_data import DataConfig, PointsConfig, SeriesConfig
from wall.core.errors import SceneError
from wall.core.files import read_file
from wall.scene.data.errors import parser_says
from wall.scene.data.samples import STEPS

MOST_STEPS = 100_000
MOST_LIST = 1 << 24  # bytes of a list of steps
MOST_NAMED = 5  # in an error


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Where one step is."""

    path: Path
    row: int | None = None  # of the first axis of an array, or of a built-in series; None: the whole file


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """Of a series, in the order of time."""

    parts: tuple[Part, ...]
    times: tuple[float, ...]  # seconds of scene time at which each is shown
    period: float | None  # seconds; None: the last one stays


def steps_of(config: DataConfig, series: SeriesConfig, path: Path, where: str) -> Steps:
    """The steps of an entry's series; that their files are there is checked, not what is in them.

    where : of the entry in the configuration, for errors. Raises SceneError.
    """
    times: tuple[float, ...] | None = None
    if path.name in STEPS:
        parts = tuple(Part(path=path, row=k) for k in range(STEPS[path.name]))
    elif path.suffix in (".pvd", ".series"):
        parts, times = _listed(path)
    elif "*" in path.name:
        parts = _matched(path, where)
    elif path.suffix == ".npy" and isinstance(config, PointsConfig):
        parts = _rows(path, where)
    else:
        wanted = "a pattern with one *, a .pvd or .series file, or a .npy of points whose first axis is time"
        raise SceneError(f"{where}.file = {config.file!r}: no series of steps; wanted {wanted}")
    if not 1 < len(parts) <= MOST_STEPS:
        raise SceneError(f"{where}.file = {config.file!r}: {len(parts)} steps; wanted 2 to {MOST_STEPS}")
    if series.step_s is not None:
        times = tuple(series.step_s * k for k in range(len(parts)))
    if times is None:
        raise SceneError(f"{where}.series.step_s: absent, and {path.name} has no times; wanted seconds between steps")
    shown = tuple(series.start_s + time - times[0] for time in times)
    last = times[-1] - times[-2]  # the last step is shown as long as the one before it
    return Steps(parts=parts, times=shown, period=shown[-1] - shown[0] + last if series.loop else None)


def _matched(path: Path, where: str) -> tuple[Part, ...]:
    """The files of a pattern by the numbers that stand for its *; a number left out is an error."""
    if str(path).count("*") > 1:
        raise SceneError(f"{where}.file: {path} has several *, wanted one, for the number of the step")
    before, after = path.name.split("*")
    numbered = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
    there = path.parent.iterdir() if path.parent.is_dir() else ()
    found = sorted((int(fits[1]), each) for each in there if (fits := numbered.fullmatch(each.name)))
    if not found:
        raise SceneError(f"{where}.file: no file is called {path} with a number for the *")
    numbers = [number for number, _ in found]
    stride = min((b - a for a, b in pairwise(numbers)), default=1)
    if stride == 0:
        twice = next(number for number in numbers if numbers.count(number) > 1)
        raise SceneError(f"{where}.file: two files of {path} have the number {twice}")
    missing = sorted(set(range(numbers[0], numbers[-1], stride)) - set(numbers))
    if missing:
        told = ", ".join(map(str, missing[:MOST_NAMED])) + ", ..." * (len(missing) > MOST_NAMED)
        raise SceneError(
            f"{where}.file: {path} lacks the numbers {told}; there are {len(numbers)}, from {numbers[0]} to "
            f"{numbers[-1]}; wanted all of them, or a .pvd file that says which there are"
        )
    return tuple(Part(path=each) for _, each in found)


def _listed(path: Path) -> tuple[tuple[Part, ...], tuple[float, ...]]:
    """The files that a .pvd or .series file names, and their times, in its own unit."""
    try:
        text = read_file(path, MOST_LIST).decode("utf-8-sig")
        rows = _of_pvd(text) if path.suffix == ".pvd" else _of_series(text)
        named = sorted((float(time), str(name)) for time, name in rows)
    except FileNotFoundError:
        raise SceneError(f"{path}: there is no such file") from None
    except (OSError, ValueError, KeyError, TypeError, ElementTree.ParseError) as error:
        raise SceneError(f"{path}: cannot be read as a list of steps, {type(error).__name__}: {error}") from error
    for (time, name), (later, other) in pairwise(named):
        if not time < later:
            raise SceneError(f"{path}: names {name} and {other} for the time {time:g}; wanted one file for each time")
    parts = [path.parent / name for _, name in named]
    missing = [f"{name} (time {time:g})" for (time, name), part in zip(named, parts, strict=True) if not part.is_file()]
    if missing:
        more = f" and {len(missing) - MOST_NAMED} more" if len(missing) > MOST_NAMED else ""
        raise SceneError(f"{path}: names files that are not there: {', '.join(missing[:MOST_NAMED])}{more}")
    return tuple(Part(path=part) for part in parts), tuple(time for time, _ in named)


def _of_pvd(text: str) -> list[tuple[Any, Any]]:
    return [(each.attrib["timestep"], each.attrib["file"]) for each in ElementTree.fromstring(text).iter("DataSet")]


def _of_series(text: str) -> list[tuple[Any, Any]]:
    return [(each["time"], each["name"]) for each in json.loads(text)["files"]]


def _rows(path: Path, where: str) -> tuple[Part, ...]:
    """The rows of an array whose first axis is time, which is not read for that."""
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except FileNotFoundError:
        raise SceneError(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise SceneError(f"{path}: cannot be read as npy, {parser_says(error)}") from error
    axes = array.ndim + (array.dtype.names is not None)
    if axes != 3:
        came = "x".join(map(str, array.shape))
        wanted = "(steps, points, columns), or (steps, points) with fields"
        raise SceneError(f"{where}.file: {path.name} is {came}, wanted {wanted}")
    return tuple(Part(path=path, row=k) for k in range(len(array)))
