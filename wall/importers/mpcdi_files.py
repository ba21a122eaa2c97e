"""The files of an MPCDI archive: a zip, or the folder of an .xml that was taken out of one; their warps and masks."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path, PurePosixPath

import numpy as np
from PIL import Image

from wall.core.data import Float32, Float64
from wall.core.errors import ConfigError
from wall.core.files import read_file
from wall.importers.report import NotThisFormat

MOST_BYTES = 1 << 28  # of one file: a warp of 4096x2160 pixels has 106 MB
MOST_FILES = 4096
GAMMA = 2.2  # of projectors, which MPCDI does not say: light = value ^ gamma


class Files:
    """What an MPCDI description names: read by its path, whatever its case, or by its file name alone."""

    def __init__(self, path: Path) -> None:
        """`path`: of the archive, or of an .xml. Raises ConfigError where an archive cannot be read."""
        self.path, self._zip = path, None
        if zipfile.is_zipfile(path):
            try:
                self._zip = zipfile.ZipFile(path)
            except (OSError, zipfile.BadZipFile, NotImplementedError) as error:
                raise ConfigError(f"{path}: is no archive that can be read ({error})") from None
            names = [item.filename for item in self._zip.infolist() if not item.is_dir()]
        else:
            names = [item.name for item in path.parent.iterdir() if item.is_file()] if path.parent.is_dir() else []
        if self._zip is not None and len(names) > MOST_FILES:
            raise ConfigError(f"{path}: has {len(names)} files; accepted: at most {MOST_FILES}")
        self._names = {name.lower(): name for name in names}
        self._short = {PurePosixPath(name).name: whole for name, whole in self._names.items()}

    def description(self) -> str:
        """The text of the archive's mpcdi.xml. Raises NotThisFormat where it has none."""
        found = [name for name in self._names if name.endswith(".xml")]
        chosen = next((name for name in found if PurePosixPath(name).name == "mpcdi.xml"), (found or [""])[0])
        if not chosen:
            raise NotThisFormat(f"{self.path}:1:1: the archive has no mpcdi.xml; accepted: an MPCDI archive")
        return (self.read(chosen) or b"").decode("utf-8-sig", "replace")

    def read(self, name: str) -> bytes | None:
        """The bytes of a file; None where there is none. Raises ConfigError for one that cannot be read."""
        key = name.strip().replace("\\", "/").lower().removeprefix("./")
        found = self._names.get(key) or self._short.get(PurePosixPath(key).name)
        if found is None:
            return None
        try:
            if self._zip is None:
                return read_file(self.path.parent / found, MOST_BYTES)
            with self._zip.open(found) as file:
                data = file.read(MOST_BYTES + 1)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise ConfigError(f"{self.path}: {found} cannot be read ({error})") from None
        if len(data) > MOST_BYTES:
            raise ConfigError(f"{self.path}: {found} has more than {MOST_BYTES} bytes")
        return data


def read_pfm(data: bytes, pixels: tuple[int, int]) -> Float64:
    """(h, w, 3) float64, the first row at the top: the vector of each of a projector's `pixels`, width and height.

    A file of as many pixels holds those of their centres; one of fewer a grid from edge to edge, linear between. NaN
    where the file has none. Raises ValueError for what is no colour PFM (Debevec's format; MPCDI begins at the top).
    """
    parts = data.split(maxsplit=3)[:3] if data[:2] == b"PF" else []
    if len(parts) < 3:
        raise ValueError("is no colour PFM")
    width, height = int(parts[1]), int(parts[2])
    rest = data[data.index(parts[2], data.index(parts[1], 2) + len(parts[1])) + len(parts[2]) :].lstrip()
    scale, _, values = rest.partition(b"\n")
    if not 2 <= width <= 1 << 14 or not 2 <= height <= 1 << 14 or len(values) < 12 * width * height:
        raise ValueError(f"has {len(values)} bytes for {width} x {height} vectors")
    kind = np.dtype("<f4" if float(scale) < 0.0 else ">f4")
    grid = np.frombuffer(values, kind, 3 * width * height).reshape(height, width, 3).astype(np.float64)
    grid[~np.isfinite(grid[..., :2]).all(axis=2)] = np.nan
    return grid if (width, height) == pixels else _between(grid, pixels)


def _between(grid: Float64, pixels: tuple[int, int]) -> Float64:
    """The grid at the centres of pixels, linear between its nodes, which stand from edge to edge."""
    for axis, count in ((1, pixels[0]), (0, pixels[1])):
        last = grid.shape[axis] - 1
        at = (np.arange(count) + 0.5) / count * last
        first = np.minimum(at.astype(int), last - 1)
        share = (at - first).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        grid = np.take(grid, first, axis) * (1.0 - share) + np.take(grid, first + 1, axis) * share
    return grid


def npy(values: Float64) -> bytes:
    """A .npy file of single precision: 1/100 pixel of 16,384."""
    out = io.BytesIO()
    np.save(out, values.astype(np.float32))
    return out.getvalue()


def mask(data: bytes, pixels: tuple[int, int], gamma: float) -> bytes:
    """A PNG of the factors of display values: of `pixels`, for a projector of GAMMA. `data`: share ^ (1 / gamma).

    Raises ValueError for what is no PNG.
    """
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as image:
            image.load()
            whole = 65535.0 if image.mode.startswith("I") else 255.0
            if image.size == pixels and gamma == GAMMA:
                return data
            plain = image if image.mode == "L" or whole > 255.0 else image.convert("RGB")
            values: Float32 = np.asarray(plain, np.float32) / np.float32(whole)
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"is no PNG ({error})") from None
    channels = [values] if values.ndim == 2 else [values[..., k] for k in range(3)]
    resized = [np.asarray(Image.fromarray(c).resize(pixels, Image.Resampling.BILINEAR)) for c in channels]
    factors = [np.clip(c, 0.0, 1.0) ** (gamma / GAMMA) for c in resized]
    out = io.BytesIO()
    if len(factors) == 1:
        Image.fromarray(np.round(factors[0] * 65535.0).astype(np.uint16)).save(out, "PNG")
    else:
        Image.fromarray(np.round(np.stack(factors, axis=-1) * 255.0).astype(np.uint8)).save(out, "PNG")
    return out.getvalue()
