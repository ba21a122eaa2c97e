"""Images of whole walls with words above them, side by side: strip.png, and the frames of the film."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from wall.display.base import PanelImage, WallImage
from wall.display.png import whole_wall
from wall.geometry.panels import Panel, Wall
from wall.study.quality.image_strips import ERROR_GAIN, GAP, Bytes

SMALLEST_LABEL = 15  # pixels, of its letters; a fortieth of a wide image
INK, PAPER = (31, 35, 40), (255, 255, 255)


def wall_image(wall: Wall, codes: Callable[[Panel], Bytes]) -> Bytes:
    """(height, width, 3) uint8 sRGB: all panels at their positions, between their bezels."""
    panels = tuple(
        PanelImage(id=panel.id, rgb=codes(panel), screen=panel.screen, version=0, span=panel.span)
        for panel in wall.panels
    )
    return whole_wall(
        WallImage(width=wall.width, height=wall.height, panels=panels, time=0.0, camera_event=0, scene_event=0)
    )


def labelled(image: Bytes, text: str) -> Bytes:
    """The image below a line of text."""
    size = max(SMALLEST_LABEL, image.shape[1] // 40)
    height = 8 * size // 5
    label = Image.new("RGB", (image.shape[1], height), PAPER)
    font = ImageFont.load_default(size)
    ImageDraw.Draw(label).text((4, height / 2), text, fill=INK, font=font, anchor="lm")
    return np.concatenate([np.asarray(label), image])


def beside(images: Sequence[Bytes]) -> Bytes:
    """Images of one height in a row, with gaps."""
    gap = np.full((images[0].shape[0], GAP, 3), 255, np.uint8)
    return np.hstack([part for image in images for part in (image, gap)][:-1])


def strip(reference: Bytes, shown: Mapping[str, tuple[Bytes, float]]) -> Bytes:
    """The reference image and those that methods showed at its moment; below, how far off they are.

    shown : by method, its image and the RMSE of its display values
    """
    blank = np.full_like(reference, PAPER[0])
    columns = [np.concatenate([labelled(reference, "reference"), labelled(blank, f"|error| x {ERROR_GAIN:g}")])]
    for method, (image, error) in shown.items():
        off = np.abs(image.astype(np.float32) - reference) * ERROR_GAIN
        below = labelled(np.clip(off, 0, 255).astype(np.uint8), f"RMSE {255.0 * error:.2f} codes")
        columns.append(np.concatenate([labelled(image, method), below]))
    return beside(columns)
