"""The pictures that a run keeps, and strips of them side by side: ideal, shown, how far off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.study.quality.cell import Cell
from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, arms_at, averaged, is_other, middle, scenes, spending

LOOKS = (0.2, 0.45, 0.7)  # of a run: when pictures are kept
IDEAL = "ideal"
ERROR_GAIN = 3.0  # of |error| as it is shown
GAP = 4  # pixels between the pictures of a strip
SHOWN = (OURS, "framed", "framed_x10", "frameless")  # and after them the best other

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What one arm showed at one moment."""

    arm: str
    rmse: float  # of this picture as it was kept, in 8 bits: within 0.002 of its display values'
    picture: Bytes  # (h, w, 3) sRGB
    error: Bytes  # (h, w, 3) |picture - ideal| * ERROR_GAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """What arms showed at one moment of one scene."""

    scene: str
    time: float  # seconds
    spending: float
    ideal: Bytes
    shown: tuple[Shown, ...]

    def strip(self) -> Bytes:
        """(2 h + GAP, ..., 3) uint8 RGB: the ideal and what was shown above, errors below."""
        above = [self.ideal, *(s.picture for s in self.shown)]
        below = [np.zeros_like(self.ideal), *(s.error for s in self.shown)]
        rows = [np.hstack([_edged(image) for image in images]) for images in (above, below)]
        return np.concatenate([rows[0], np.full((GAP, rows[0].shape[1], 3), 255, np.uint8), rows[1]])


def picture_path(out: Path, number: int, *, scene: str, size: tuple[int, int], arm: str, spent: str) -> Path:
    """Where a run keeps picture `number` (of LOOKS); `spent` says at what rate, or with how many cores."""
    about = IDEAL if arm == IDEAL else f"{arm.replace(':', '.')}-{spent}"
    return out / "pictures" / scene / f"{size[0]}x{size[1]}-{about}-{number}.png"


def spent_by(cell_or_row: Cell | Row) -> str:
    """A spending as part of a file's name."""
    return f"{cell_or_row.cores:g}cores" if cell_or_row.clock == "cpu" else f"{cell_or_row.rate:.0f}"


def moments(out: Path, rows: Sequence[Row]) -> list[Moment]:
    """Every kept moment of every scene at the middle spending, as far as its pictures are there."""
    spent, found = middle(rows), []
    for scene in scenes(rows):
        here = [row for row in rows if row.scene == scene]
        for number, share in enumerate(LOOKS):
            paths = {arm: _path(out, here, arm, spent, number) for arm in (IDEAL, *arms_shown(rows, scene, spent))}
            pictures = {
                arm: np.asarray(Image.open(path).convert("RGB")) for arm, path in paths.items() if path.exists()
            }
            if IDEAL in pictures and len(pictures) > 1:
                time = min(here[0].times, key=lambda t: abs(t - share * here[0].seconds))
                found.append(_moment(scene, time, spent, pictures))
    return found


def arms_shown(rows: Sequence[Row], scene: str, spent: float) -> list[str]:
    """Those of SHOWN that ran, and the best of the others."""
    errors, arms = averaged(rows), arms_at(rows, spent)
    there = [arm for arm in SHOWN if arm in arms]
    others = [a for a in arms if is_other(a) and a not in SHOWN and (scene, a, spent) in errors]
    return [*there, *sorted(others, key=lambda arm: errors[scene, arm, spent])[:1]]


def _path(out: Path, here: Sequence[Row], arm: str, spent: float, number: int) -> Path:
    row = next((row for row in here if row.arm == arm and spending(row) == spent), here[0])
    size = (row.width, row.height)
    return picture_path(out, number, scene=row.scene, size=size, arm=arm, spent=spent_by(row))


def _moment(scene: str, time: float, spent: float, pictures: Mapping[str, Bytes]) -> Moment:
    ideal = pictures[IDEAL]
    shown = []
    for arm, picture in pictures.items():
        if arm != IDEAL:
            off = picture.astype(np.float32) - ideal
            error = np.clip(np.abs(off) * ERROR_GAIN, 0, 255).astype(np.uint8)
            rmse = float(np.sqrt(np.mean(np.square(off / 255.0))))
            shown.append(Shown(arm=arm, rmse=rmse, picture=picture, error=error))
    return Moment(scene=scene, time=time, spending=spent, ideal=ideal, shown=tuple(shown))


def _edged(image: Bytes) -> Bytes:
    return np.hstack([image, np.full((image.shape[0], GAP, 3), 255, np.uint8)])
