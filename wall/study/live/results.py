"""What is kept of the images of a run, and what is made of those of several: strip.png and film.mp4."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from wall.display.files import replaced
from wall.display.film import write_film
from wall.study.live.film import OWN_WIDTH, QUALITY, hz_of, scaled, side_by_side
from wall.study.live.images import strip, wall_image
from wall.study.live.reference import WallReference
from wall.study.live.rows import Row
from wall.study.live.scores import Shown
from wall.study.quality.image_strips import Bytes

REFERENCE, SHOWN, STRIP, FILM = "reference.png", "shown.png", "strip.png", "film.mp4"


def keep(
    folder: Path, shown: Shown, reference: WallReference, *, first: float, seconds: float, hz: float
) -> None:  # fmt: skip
    """Write what strip and film are made of: the images of one moment, and the film of this run."""
    k, wall = _middle(reference.times), reference.wall
    _write(folder.parent / REFERENCE, wall_image(wall, lambda panel: reference.codes(panel.id, k)))
    _write(folder / SHOWN, wall_image(wall, lambda panel: shown.codes(panel, reference.times[k])))

    def image(time: float) -> Bytes:
        return scaled(wall_image(wall, lambda panel: shown.codes(panel, time)), OWN_WIDTH)

    write_film(folder / FILM, (image(first + n / hz) for n in range(round(seconds * hz))), hz=hz)


def compose(folder: Path, rows: Sequence[Row]) -> None:
    """strip.png and film.mp4 of methods that were measured on the same configuration and cores."""
    shown = {row.method: (_read(folder / row.method / SHOWN), row.error_over_time[_middle(row.times)]) for row in rows}
    _write(folder / STRIP, strip(_read(folder / REFERENCE), shown))
    films = {
        f"{row.method}: RMSE {255.0 * row.rmse_display:.2f} codes, {row.refresh_hz:.1f} Hz": folder / row.method / FILM
        for row in rows
    }
    hz = hz_of(folder / rows[0].method / FILM)
    write_film(folder / FILM, side_by_side(films), hz=hz, quality=QUALITY)


def _middle(values: Sequence[float]) -> int:
    """Index of the moment whose images are kept."""
    return len(values) // 2


def _read(path: Path) -> Bytes:
    return np.asarray(Image.open(path).convert("RGB"))


def _write(path: Path, image: Bytes) -> None:
    with replaced(path) as part:
        Image.fromarray(image).save(part, format="PNG")
