"""`wall tiles`: cut a very large image into the tiles of a Deep Zoom Image, which `deep_zoom` shows."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias, get_args
from xml.sax.saxutils import quoteattr

from wall.core.errors import ConfigError, RunError
from wall.operators.pyramid import Shape, halved, opened

TileFormat: TypeAlias = Literal["jpg", "png"]
TILE = 256  # pixels
QUALITY = 90  # of JPEG
MOST_PIXELS = 1 << 31  # of an image that is cut up: it is in memory whole, up to 8 bytes a pixel
XMLNS = "http://schemas.microsoft.com/deepzoom/2008"


def format_of(text: str) -> TileFormat:
    """The format of tiles. Raises ConfigError."""
    found = next((each for each in get_args(TileFormat) if each == text), None)
    if found is None:
        raise ConfigError(f"--format {text}; wanted {' or '.join(get_args(TileFormat))}")
    return found  # type: ignore[no-any-return]


def cut_up(image_file: Path, output: Path, tile_format: TileFormat, progress: Callable[[int, int], None]) -> Shape:
    """Write OUTPUT.dzi and its folder of tiles; `progress` is told the tiles done, and all there are.

    Raises ConfigError for a file that is no image, or an output that is there; RunError where it cannot be written.
    """
    folder = output.with_name(f"{output.stem}_files")
    if output.suffix.lower() != ".dzi":
        raise ConfigError(f"-o {output}: wanted a name that ends in .dzi")
    for there in (output, folder):
        if there.exists():
            raise ConfigError(f"{there}: is there already; wanted another name, or remove it")
    image = opened(image_file, most_pixels=MOST_PIXELS)
    image = image.convert("RGB") if tile_format == "jpg" else image
    shape = Shape(*image.size, TILE)
    sizes = [shape.size(level) for level in range(shape.top + 1)]
    total = sum(-(-width // TILE) * -(-height // TILE) for width, height in sizes)
    part, named, done = folder.with_name(f".{folder.name}.part"), output.with_name(f".{output.name}.part"), 0
    try:
        shutil.rmtree(part, ignore_errors=True)
        for level, smaller in zip(range(shape.top, -1, -1), halved(image), strict=True):
            (part / str(level)).mkdir(parents=True)
            for _, column, row in shape.tiles(level, (0, 0, *smaller.size)):
                x, y = column * TILE, row * TILE
                box = (x, y, min(x + TILE, smaller.width), min(y + TILE, smaller.height))
                smaller.crop(box).save(part / str(level) / f"{column}_{row}.{tile_format}", quality=QUALITY)
                done += 1
                progress(done, total)
        named.write_text(
            f'<?xml version="1.0" encoding="UTF-8"?>\n<Image xmlns={quoteattr(XMLNS)} Format="{tile_format}" '
            f'Overlap="0" TileSize="{TILE}">\n  <Size Width="{shape.width}" Height="{shape.height}"/>\n</Image>\n',
            encoding="utf-8",
        )
        part.rename(folder)
        named.rename(output)
    except OSError as error:
        raise RunError(f"{output}: cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
        named.unlink(missing_ok=True)
    return shape
