"""Read and apply 3D look-up tables of colours: .cube files (Adobe, Cube LUT Specification 1.0, 2013)."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wall.core.data import Float32
from wall.core.errors import ConfigError
from wall.core.files import read_file
from wall.operators.kernels import resample as kernels

SIZES = (2, 256)  # nodes an edge that the format allows
IGNORED = ("TITLE",)
MOST_BYTES = 1 << 29  # of a file: the largest table, with 30 characters a colour
LARGEST = 1e30  # sums and products of numbers below it are finite in float32


@dataclass(frozen=True, slots=True, eq=False)
class Lut:
    """A table of colours over a box of colours."""

    table: Float32  # (N, N, N, 3), indexed blue, green, red
    low: Float32  # (3,) the colour of the first node
    high: Float32  # (3,) of the last

    def __call__(self, colours: Float32, *, tetrahedral: bool = True) -> Float32:
        """(..., 3) float32 through the table, clipped to its box.

        Linear between nodes, hence exact for tables of linear functions. Of a function whose Hessian has no norm above
        M, nodes h apart, either way is at most 3 h^2 M / 8 off: per axis h^2 M / 8 for trilinear; for tetrahedral half
        of M times the squared radius, 3 h^2 / 4, of the sphere around the tetrahedron's nodes.
        """
        nodes = ((colours - self.low) * ((len(self.table) - 1) / (self.high - self.low))).astype(np.float32)
        flat = np.ascontiguousarray(nodes.reshape(-1, 3))
        out = np.empty_like(flat)
        kernels.look_up_colours(flat, self.table, tetrahedral, out)
        return out.reshape(colours.shape)


def read_lut(path: Path) -> Lut:
    """Read a .cube file. Raises ConfigError naming file and line."""
    try:
        text = read_file(path, MOST_BYTES).decode("utf-8", "replace")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read, {error.strerror or error}") from error
    return _Parser(path).parse(text)


class _Parser:
    """Parses one file; errors name it and the line."""

    def __init__(self, path: Path) -> None:
        self._path, self._line = path, 0
        self._size = 0
        self._domain = {"DOMAIN_MIN": [0.0] * 3, "DOMAIN_MAX": [1.0] * 3}

    def parse(self, text: str) -> Lut:
        """The table of a file's text."""
        values, count = array("f"), 0  # 16.8 million colours are 200 MB
        for words in self._lines(text):
            if words[0][0].isalpha() or words[0][0] == '"':
                if count:
                    raise self._error(f"{words[0]} after the first colour, wanted keywords before all colours")
                self._keyword(words)
            elif not self._size:
                raise self._error("a colour before LUT_3D_SIZE, wanted the size first")
            elif count == self._size**3:
                raise self._error(f"more colours than the {self._size}^3 = {self._size**3} that LUT_3D_SIZE promises")
            else:
                values.extend(self._numbers(words))
                count += 1
        if not self._size:
            raise ConfigError(f"{self._path}: no LUT_3D_SIZE, wanted a .cube file with a 3D table")
        if count < self._size**3:
            wanted = f"{self._size}^3 = {self._size**3}"
            raise ConfigError(f"{self._path}:{self._line}: ends after {count} colours, wanted {wanted}")
        low, high = (np.array(self._domain[f"DOMAIN_{end}"], np.float32) for end in ("MIN", "MAX"))
        if not (low < high).all():
            raise ConfigError(f"{self._path}: DOMAIN_MAX {high.tolist()} is not above DOMAIN_MIN {low.tolist()}")
        return Lut(np.frombuffer(values, np.float32).reshape(*[self._size] * 3, 3), low, high)

    def _lines(self, text: str) -> Iterator[list[str]]:
        for self._line, line in enumerate(text.removeprefix("\ufeff").splitlines(), start=1):
            if words := line.split("#", 1)[0].split():
                yield words

    def _keyword(self, words: list[str]) -> None:
        match words:
            case ["LUT_3D_SIZE", size] if size.isdecimal() and SIZES[0] <= int(size) <= SIZES[1]:
                self._size = int(size)
            case ["LUT_3D_SIZE", *rest]:
                raise self._error(f"LUT_3D_SIZE {' '.join(rest)}, wanted one number, {SIZES[0]} to {SIZES[1]}")
            case ["LUT_1D_SIZE", *_]:
                raise self._error("LUT_1D_SIZE, wanted a 3D table; gain and gamma do without one")
            case ["DOMAIN_MIN" | "DOMAIN_MAX" as end, *rest]:
                self._domain[end] = self._numbers(rest)
            case ["LUT_3D_INPUT_RANGE", low, high]:  # of DaVinci Resolve: one range for all three
                ends = self._numbers([low, high], count=2)
                self._domain = {"DOMAIN_MIN": [ends[0]] * 3, "DOMAIN_MAX": [ends[1]] * 3}
            case [word, *_] if word not in IGNORED:
                raise self._error(f"{word}, wanted LUT_3D_SIZE, DOMAIN_MIN, DOMAIN_MAX, TITLE or a colour")

    def _numbers(self, words: list[str], *, count: int = 3) -> list[float]:
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(abs(number) <= LARGEST for number in numbers):
            raise self._error(f"'{' '.join(words)[:60]}', wanted {count} numbers")
        return numbers

    def _error(self, problem: str) -> ConfigError:
        return ConfigError(f"{self._path}:{self._line}: {problem}")
