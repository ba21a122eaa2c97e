"""Images larger than memory as pyramids of tiles: Deep Zoom Images (.dzi), and files that Pillow reads, whole.

A Deep Zoom Image is a small XML file NAME.dzi beside a folder NAME_files/LEVEL/COLUMN_ROW.FORMAT. Level 0 has one
pixel, each next one twice as many along an edge, up to the image itself. Tiles may overlap. (Format: Microsoft, "Deep
Zoom File Format Overview".)
"""

from __future__ import annotations

import re
import threading
import xml.etree.ElementTree
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.core.errors import ConfigError
from wall.core.files import open_file

Codes: TypeAlias = NDArray[np.uint8]  # (h, w, 4) sRGB and alpha
TileKey: TypeAlias = tuple[int, int, int]  # level, column, row
MOST_WHOLE = 1 << 26  # pixels of a file that is read whole: 360 MB with its levels, 0.9 GB while it is read
READ_AT_ONCE = 1 << 22  # pixels: a tenth of a second, once
MOST_EDGE, MOST_TILE = 1 << 26, 1 << 12  # pixels, of an image and of a tile
MOST_XML = 1 << 16  # bytes
WHOLE_FORMATS = ("PNG", "JPEG", "TIFF")


@dataclass(frozen=True, slots=True)
class Shape:
    """How an image is cut up."""

    width: int  # pixels
    height: int
    tile: int  # edge, pixels, without overlap
    overlap: int = 0  # pixels that a tile shares with each neighbour

    @property
    def top(self) -> int:
        """The level that is the image itself; level 0 is one pixel."""
        return (max(self.width, self.height) - 1).bit_length()

    def size(self, level: int) -> tuple[int, int]:
        """Width and height of a level, pixels."""
        part = 1 << (self.top - level)
        return -(-self.width // part), -(-self.height // part)

    def tiles(self, level: int, box: tuple[int, int, int, int]) -> Iterator[TileKey]:
        """The tiles of a level that hold pixels of `box`: left, top, right, bottom, inside the level."""
        left, top, right, bottom = box
        for row in range(top // self.tile, -(-bottom // self.tile)):
            for column in range(left // self.tile, -(-right // self.tile)):
                yield level, column, row


class Pyramid:
    """`read` gives a tile as it is in its file; without its overlap it lies at column * tile, row * tile."""

    def __init__(self, path: Path, shape: Shape, read: Callable[[TileKey], Codes], *, at_once: bool = False) -> None:
        """`at_once`: reading takes no longer than an image may wait."""
        self.path, self.shape, self._read, self.at_once = path, shape, read, at_once

    def tile(self, key: TileKey) -> Codes:
        """(h, w, 4) uint8, without overlap. Raises ConfigError where the file is missing, broken or of another size."""
        codes, (level, column, row), shape = self._read(key), key, self.shape
        x, y = column * shape.tile, row * shape.tile
        width, height = shape.size(level)
        left, top = min(column, 1) * shape.overlap, min(row, 1) * shape.overlap
        own = min(shape.tile, width - x), min(shape.tile, height - y)
        most = shape.tile + shape.overlap
        wanted = min(most, width - x) + left, min(most, height - y) + top
        if codes.shape[:2] != wanted[::-1]:
            came = f"{codes.shape[1]} x {codes.shape[0]}"
            raise ConfigError(
                f"{self.path}: tile {column}_{row} of level {level} has {came} pixels, wanted {wanted[0]} x {wanted[1]}"
            )
        return codes[top : top + own[1], left : left + own[0]]


def open_pyramid(path: Path) -> Pyramid:
    """The pyramid of a .dzi, or of a PNG, JPEG or TIFF, which is read whole. Raises ConfigError naming the file."""
    if not path.is_file():
        raise ConfigError(f"{path}: there is no such file")
    return _of_tiles(path) if path.suffix.lower() == ".dzi" else _whole(path)


def size_of(path: Path) -> tuple[int, int]:
    """Width and height of a pyramid's image, of which no pixel is read. Raises ConfigError."""
    if path.suffix.lower() == ".dzi":
        shape, _ = read_descriptor(path)
        return shape.width, shape.height
    try:
        with (
            open_file(path) as file,
            unlimited(MOST_EDGE * MOST_EDGE),
            Image.open(file, formats=WHOLE_FORMATS) as image,
        ):
            return image.size
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ConfigError(f"{path}: cannot be read as an image: {error}") from error


def _of_tiles(path: Path) -> Pyramid:
    shape, suffix = read_descriptor(path)
    folder = path.with_name(f"{path.stem}_files")

    def read(key: TileKey) -> Codes:
        level, column, row = key
        return _codes_of(folder / str(level) / f"{column}_{row}.{suffix}")

    found = Pyramid(path, shape, read)
    width, height = shape.size(shape.top)
    found.tile((shape.top, (width - 1) // shape.tile, (height - 1) // shape.tile))  # one that another's folder lacks
    return found


def read_descriptor(path: Path) -> tuple[Shape, str]:
    """The shape that a .dzi names, and the suffix of its tiles. Raises ConfigError."""
    try:
        with open_file(path) as file:
            text = file.read(MOST_XML)
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise ValueError("it declares entities")
        image = xml.etree.ElementTree.fromstring(text)
        size = next((each for each in image if each.tag.rpartition("}")[2] == "Size"), None)
        if size is None:
            raise ValueError("it names no Size")
        width, height = int(size.attrib["Width"]), int(size.attrib["Height"])
        tile, overlap = int(image.attrib["TileSize"]), int(image.attrib["Overlap"])
        suffix = image.attrib["Format"].lower()
        if not (0 < max(width, height) <= MOST_EDGE and min(width, height) > 0):
            raise ValueError(f"{width} x {height} pixels, wanted 1 to {MOST_EDGE} along an edge")
        if not (0 < tile <= MOST_TILE and 0 <= overlap < tile):
            raise ValueError(f"TileSize {tile}, Overlap {overlap}; wanted tiles of 1 to {MOST_TILE} and less overlap")
        if not re.fullmatch("png|jpg|jpeg", suffix):
            raise ValueError(f"Format {suffix!r}, wanted png, jpg or jpeg")
    except (OSError, ValueError, KeyError, xml.etree.ElementTree.ParseError) as error:
        raise ConfigError(f"{path}: is no Deep Zoom Image that can be read ({error})") from None
    return Shape(width, height, tile, overlap), suffix


def _codes_of(path: Path) -> Codes:
    """(h, w, 4) uint8 of an image file of any size that a tile may have. Raises ConfigError."""
    try:
        with open_file(path) as file, Image.open(file, formats=["PNG", "JPEG"]) as image:
            if max(image.size) > 3 * MOST_TILE:
                raise ValueError(f"{image.size[0]} x {image.size[1]} pixels")
            return np.asarray(image.convert("RGBA"))
    except FileNotFoundError:
        raise ConfigError(f"{path}: there is no such tile") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, MemoryError) as error:
        raise ConfigError(f"{path}: cannot be read as a tile ({error})") from error


def _whole(path: Path) -> Pyramid:
    """A file as one tile a level, each half of the one before; it is read when a tile is."""
    width, height = size_of(path)
    if width * height > MOST_WHOLE:
        raise ConfigError(
            f"{path}: {width} x {height} pixels, at most {MOST_WHOLE:,} are read whole; wanted a .dzi: wall tiles "
            f"{path.name} -o {path.stem}.dzi"
        )
    levels = list[Codes]()
    lock = threading.Lock()

    def read(key: TileKey) -> Codes:
        with lock:
            if not levels:
                levels.extend(reversed([np.asarray(level.convert("RGBA")) for level in halved(opened(path))]))
        return levels[key[0]]

    return Pyramid(path, Shape(width, height, max(width, height)), read, at_once=width * height <= READ_AT_ONCE)


def opened(path: Path, *, most_pixels: int = MOST_WHOLE) -> Image.Image:
    """A PNG, JPEG or TIFF as RGB, or RGBA where it has alpha, 8 bits each. Raises ConfigError."""
    try:
        with open_file(path) as file, unlimited(most_pixels), Image.open(file, formats=WHOLE_FORMATS) as image:
            if image.width * image.height > most_pixels:
                raise ValueError(f"{image.width} x {image.height} pixels, at most {most_pixels:,}")
            if image.mode.startswith("I;16"):
                return Image.fromarray((np.asarray(image).astype(np.uint16) >> 8).astype(np.uint8)).convert("RGB")
            if image.mode in ("I", "F"):
                raise ValueError("pixels of 32 bits; wanted 8 or 16 bits a channel")
            return image.convert("RGBA" if has_alpha(image) else "RGB")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, MemoryError) as error:
        raise ConfigError(f"{path}: cannot be read as PNG, JPEG or TIFF ({error})") from error


@contextmanager
def unlimited(most_pixels: int) -> Iterator[None]:
    """Let Pillow open images of so many pixels: its own limit is for files of strangers."""
    before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, most_pixels
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before


def has_alpha(image: Image.Image) -> bool:
    """Whether some of its pixels may not be opaque."""
    return "A" in image.getbands() or "transparency" in image.info


def halved(image: Image.Image) -> Iterator[Image.Image]:
    """An image, half of it, and so on to one pixel; edges of odd length are rounded up, their last pixel repeated."""
    yield image
    while max(image.size) > 1:
        width, height = image.size
        even = width + width % 2, height + height % 2
        if even != image.size:
            padded = Image.new(image.mode, even)
            padded.paste(image.crop((width - 1, 0, width, height)), (even[0] - 1, 0))
            padded.paste(image.crop((0, height - 1, width, height)), (0, even[1] - 1))
            padded.paste(image.crop((width - 1, height - 1, width, height)), (even[0] - 1, even[1] - 1))
            padded.paste(image, (0, 0))
            image = padded
        image = image.reduce(2)
        yield image
