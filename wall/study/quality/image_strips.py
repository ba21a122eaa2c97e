"""The images that a run keeps, and strips of them side by side: reference, shown, how far off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wall.study.quality.rows import Row
from wall.study.quality.summary import OURS, averaged, is_other, methods_at, middle, scenes, spending
from wall.study.quality.trial import Trial

LOOKS = (0.2, 0.45, 0.7)  # of a run: when images are kept
REFERENCE = "reference"
ERROR_GAIN = 3.0  # of |error| as it is shown
GAP = 4  # pixels between the images of a strip
SHOWN = (OURS, "framed", "framed_x10", "frameless")  # and after them the best other

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodImage:
    """What one method showed at one moment."""

    method: str
    rmse: float  # of this image as it was kept, in 8 bits: within 0.002 of its display values'
    image: Bytes  # (h, w, 3) sRGB
    error: Bytes  # (h, w, 3) |image - reference| * ERROR_GAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """What methods showed at one moment of one scene."""

    scene: str
    time: float  # seconds
    spending: float
    reference: Bytes
    shown: tuple[MethodImage, ...]

    def strip(self) -> Bytes:
        """(2 h + GAP, ..., 3) uint8 RGB: the reference and what was shown above, errors below."""
        above = [self.reference, *(s.image for s in self.shown)]
        below = [np.zeros_like(self.reference), *(s.error for s in self.shown)]
        rows = [np.hstack([_edged(image) for image in images]) for images in (above, below)]
        return np.concatenate([rows[0], np.full((GAP, rows[0].shape[1], 3), 255, np.uint8), rows[1]])


def image_path(out: Path, number: int, *, scene: str, size: tuple[int, int], method: str, spent: str) -> Path:
    """Where a run keeps image `number` (of LOOKS); `spent` says at what rate, or with how many cores."""
    about = REFERENCE if method == REFERENCE else f"{method.replace(':', '.')}-{spent}"
    return out / "pictures" / scene / f"{size[0]}x{size[1]}-{about}-{number}.png"


def spent_by(trial_or_row: Trial | Row) -> str:
    """A spending as part of a file's name."""
    return f"{trial_or_row.cores:g}cores" if trial_or_row.clock == "cpu" else f"{trial_or_row.rate:.0f}"


def moments(out: Path, rows: Sequence[Row]) -> list[Moment]:
    """Every kept moment of every scene at the middle spending, as far as its images are there."""
    spent, found = middle(rows), []
    for scene in scenes(rows):
        here = [row for row in rows if row.scene == scene]
        for number, share in enumerate(LOOKS):
            names = (REFERENCE, *methods_shown(rows, scene, spent))
            paths = {name: _path(out, here, name, spent, number) for name in names}
            images = {
                method: np.asarray(Image.open(path).convert("RGB")) for method, path in paths.items() if path.exists()
            }
            if REFERENCE in images and len(images) > 1:
                time = min(here[0].times, key=lambda t: abs(t - share * here[0].seconds))
                found.append(_moment(scene, time, spent, images))
    return found


def methods_shown(rows: Sequence[Row], scene: str, spent: float) -> list[str]:
    """Those of SHOWN that ran, and the best of the others."""
    errors, methods = averaged(rows), methods_at(rows, spent)
    there = [method for method in SHOWN if method in methods]
    others = [a for a in methods if is_other(a) and a not in SHOWN and (scene, a, spent) in errors]
    return [*there, *sorted(others, key=lambda method: errors[scene, method, spent])[:1]]


def _path(out: Path, here: Sequence[Row], method: str, spent: float, number: int) -> Path:
    row = next((row for row in here if row.method == method and spending(row) == spent), here[0])
    size = (row.width, row.height)
    return image_path(out, number, scene=row.scene, size=size, method=method, spent=spent_by(row))


def _moment(scene: str, time: float, spent: float, images: Mapping[str, Bytes]) -> Moment:
    reference = images[REFERENCE]
    shown = []
    for method, image in images.items():
        if method != REFERENCE:
            off = image.astype(np.float32) - reference
            error = np.clip(np.abs(off) * ERROR_GAIN, 0, 255).astype(np.uint8)
            rmse = float(np.sqrt(np.mean(np.square(off / 255.0))))
            shown.append(MethodImage(method=method, rmse=rmse, image=image, error=error))
    return Moment(scene=scene, time=time, spending=spent, reference=reference, shown=tuple(shown))


def _edged(image: Bytes) -> Bytes:
    return np.hstack([image, np.full((image.shape[0], GAP, 3), 255, np.uint8)])
