"""Write the last image of a run as PNG files: the whole wall with its bezels, and every panel."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.core.errors import LocalProtocolError, RunError
from wall.display.base import PanelImage, Status, WallImage
from wall.display.files import replaced
from wall.display.saving import SAVE_S, Saver

BEZEL_RGB = (13, 14, 17)  # sRGB; a little lighter than black: a dark panel keeps its edge
QUICK = 1  # zlib level: half the time of the default for 15 % more bytes


def whole_wall(image: WallImage) -> NDArray[np.uint8]:
    """All panels at their positions in the virtual screen.

    Returns (height, width, 3) uint8 sRGB; pixels that belong to no panel have BEZEL_RGB. Where panels
    overlap, the later one is seen. Raises LocalProtocolError when a panel leaves the virtual screen.
    """
    out = np.empty((image.height, image.width, 3), np.uint8)
    out[:] = BEZEL_RGB
    for panel in image.panels:
        (x, y), rgb = panel.screen, spread(panel)
        h, w = rgb.shape[:2]
        if x < 0 or y < 0 or x + w > image.width or y + h > image.height:
            raise LocalProtocolError(
                f"panel {panel.id}: {w} x {h} pixels at ({x}, {y}) leave the virtual screen "
                f"of {image.width} x {image.height}"
            )
        out[y : y + h, x : x + w] = rgb
    return out


def png_bytes(image: WallImage) -> bytes:
    """The whole wall as a PNG file."""
    out = BytesIO()
    Image.fromarray(whole_wall(image)).save(out, format="PNG", compress_level=QUICK)
    return out.getvalue()


def spread(panel: PanelImage) -> NDArray[np.uint8]:
    """(h, w, 3) uint8: a panel's image scaled to its size in the virtual screen, each pixel a rectangle."""
    if panel.span is None or panel.span == (panel.rgb.shape[1], panel.rgb.shape[0]):
        return panel.rgb
    return np.asarray(Image.fromarray(panel.rgb).resize(panel.span, Image.Resampling.NEAREST))


def file_names(ids: list[str], *, stem: str = "panel", suffix: str = ".png") -> list[str]:
    """One file name a panel: STEM-ID.png, characters that a path could trip over replaced, all different."""
    names: list[str] = []
    for panel_id in ids:
        own = f"{stem}-{re.sub(r'[^A-Za-z0-9._-]', '_', panel_id)[:64] or '_'}"
        taken = {name.lower() for name in names}  # some file systems do not tell upper from lower case
        tries = (own if n == 1 else f"{own}~{n}" for n in range(1, len(ids) + 1))
        names.append(next(t + suffix for t in tries if (t + suffix).lower() not in taken))
    return names


def make_folder(folder: Path) -> None:
    """Create a folder. Raises RunError naming it and the reason when that cannot be done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"cannot create the folder {folder}: {error.strerror or error}") from error


def write_png(path: Path, rgb: NDArray[np.uint8]) -> None:
    """Write (h, w, 3) uint8 sRGB; a reader of `path` sees the old file or the whole new one, never a part.

    Raises RunError naming the file and the reason when it cannot be written.
    """
    with replaced(path) as part:
        Image.fromarray(rgb).save(part, format="PNG", compress_level=QUICK)


def write_images(folder: Path, image: WallImage) -> list[Path]:
    """Write wall.png, the whole wall with its bezels, and panel-ID.png for every panel. Returns the files.

    Raises RunError naming the file that could not be written.
    """
    files = [folder / name for name in ("wall.png", *file_names([panel.id for panel in image.panels]))]
    write_png(files[0], whole_wall(image))
    for file, panel in zip(files[1:], image.panels, strict=True):
        write_png(file, panel.rgb)
    return files


class PngSink:
    """Keeps the newest image and writes it every few seconds; `close` writes the last one. See write_images."""

    def __init__(self, folder: Path, *, every_s: float = SAVE_S) -> None:
        make_folder(folder)
        Image.preinit()  # now: a process that is copied while one of its threads imports cannot import any more
        self._folder = folder
        self._image: WallImage | None = None
        self._written: WallImage | None = None
        self._saver = Saver(self.save, every_s=every_s)

    def show(self, image: WallImage, status: Status) -> None:
        """Keep the image."""
        self._image = image

    def save(self) -> None:
        """Write the files, unless they are written. Raises RunError naming the file that could not be."""
        image = self._image
        if image is not None and image is not self._written:
            write_images(self._folder, image)
            self._written = image

    def close(self) -> None:
        """Write the last image, if one was shown. Raises RunError naming the file that could not be written."""
        self._saver.close()
        self.save()

    def dropped(self) -> dict[str, int]:
        """How often the images could not be written."""
        return {"png_unwritten": self._saver.failed} if self._saver.failed else {}
