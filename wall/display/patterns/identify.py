"""Identify: the panel's name, position and size, and an arrow that points up."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from wall.display.patterns.draw import (
    AMBER,
    BRIGHT,
    CYAN,
    GREEN,
    PLAIN,
    ROSE,
    SMALLEST,
    VIOLET,
    blank,
    blend,
    draw_text,
    fitting_size,
)
from wall.display.patterns.unfolding import UnfoldedPanel
from wall.geometry.panels import Panel

HUES = (AMBER, CYAN, ROSE, GREEN, VIOLET)
FINER = 4  # the arrow is drawn so many times larger, then shrunk: smooth edges


def identify(panel: Panel, unfolded: UnfoldedPanel, about: Sequence[tuple[str, str]]) -> NDArray[np.uint8]:
    """See wall.display.patterns.pattern."""
    width, height = panel.pixels
    image, hue = blank(panel.pixels), HUES[panel.index % len(HUES)]
    edge = max(1, min(width, height) // 100)
    image[:edge], image[-edge:], image[:, :edge], image[:, -edge:] = (hue,) * 4
    _arrow(image, (round(0.5 * width), round(0.06 * height)), round(0.14 * min(width, height)), hue)
    size = fitting_size(panel.id, (0.7 * width, 0.2 * height))
    draw_text(image, panel.id, (0.5 * width, 0.36 * height), size, BRIGHT, anchor="mm")
    rows = [*about, *_own_rows(panel, unfolded)]
    _table(image, rows, top=0.52 * height, bottom=0.88 * height)
    _corners(image, panel, edge)
    return image


def _own_rows(panel: Panel, unfolded: UnfoldedPanel) -> list[tuple[str, str]]:
    (width, height), pitch = panel.pixels, (np.linalg.norm(unfolded.per_x), np.linalg.norm(unfolded.per_y))
    rows = [
        ("pixels", f"{width} x {height} at {panel.screen[0]}, {panel.screen[1]}"),
        ("size", f"{width * pitch[0]:.3f} x {height * pitch[1]:.3f} m, {1000 * unfolded.pitch:.3g} mm a pixel"),
    ]
    return [*rows, ("mounted", f"turned {panel.config.rotation}° clockwise")] if panel.config.rotation else rows


def _table(image: NDArray[np.uint8], rows: Sequence[tuple[str, str]], *, top: float, bottom: float) -> None:
    """Names to the left of a line, texts to its right."""
    width, step = image.shape[1], (bottom - top) / max(4, len(rows))
    tall = max(0.62 * step, min(SMALLEST + 1, 0.9 * step))  # on a small panel rows move together before they shrink
    size = max(1, min(*(fitting_size(text, (0.6 * width, step)) for _, text in rows), int(tall)))
    for k, (name, text) in enumerate(rows):
        y = top + (k + 0.5) * step
        draw_text(image, name, (0.33 * width, y), size, PLAIN, anchor="rm")
        draw_text(image, text, (0.36 * width, y), size, BRIGHT, anchor="lm")


def _corners(image: NDArray[np.uint8], panel: Panel, edge: int) -> None:
    """Draw the three configured corners' coordinates, in metres, each in its corner."""
    height, width = image.shape[:2]
    gap = 2 * edge + max(2, height // 60)
    anchors = ((gap, height - gap, "lb"), (width - gap, height - gap, "rb"), (gap, gap, "lt"))
    texts = [", ".join(f"{x:.3f}" for x in corner) for corner in (panel.surface or panel).corners]
    size = min(fitting_size(text, (0.4 * width, 0.035 * height)) for text in texts)
    for (x, y, anchor), text in zip(anchors, texts, strict=True):
        draw_text(image, text, (x, y), size, PLAIN, anchor=anchor)


def _arrow(image: NDArray[np.uint8], tip: tuple[int, int], height: int, colour: tuple[int, int, int]) -> None:
    """An arrow that points up, its tip at `tip`."""
    side = height * FINER
    mask = Image.new("L", (side, side))
    head, stem = 0.55 * side, 0.13 * side
    middle = side / 2
    ImageDraw.Draw(mask).polygon(
        [(middle, 0), (middle + 0.38 * side, head), (middle + stem, head), (middle + stem, side - 1),
         (middle - stem, side - 1), (middle - stem, head), (middle - 0.38 * side, head)],
        fill=255,
    )  # fmt: skip
    coverage = np.asarray(mask.resize((height, height), Image.Resampling.BOX), np.float32) / 255
    x = tip[0] - height // 2
    blend(image[tip[1] : tip[1] + height, x : x + height], coverage, colour)
