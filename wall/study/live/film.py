"""Films in H.264: what one run showed, in real time; and those of several methods side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import ceil, sqrt
from pathlib import Path

import numpy as np
from PIL import Image

from wall.display.film import read_film
from wall.study.live.images import PAPER, beside, labelled
from wall.study.quality.image_strips import GAP, Bytes

QUALITY = 20  # x264's constant rate factor, of the film of all methods
OWN_WIDTH, WIDTH = 960, 1920  # pixels at most
SLOWEST_HZ, FASTEST_HZ = 24.0, 60.0


def hz_of(path: Path) -> float:
    """Images a second of a film."""
    import av

    with av.open(str(path)) as film:
        return float(film.streams.video[0].average_rate or SLOWEST_HZ)


def film_hz(refresh_hz: float) -> float:
    """Images a second of the film of a wall."""
    return min(max(refresh_hz, SLOWEST_HZ), FASTEST_HZ)


def scaled(image: Bytes, width: int) -> Bytes:
    """The image, smaller if it is wider than `width`, pixels repeated if it is less than half as wide."""
    if image.shape[1] <= width:
        times = width // image.shape[1]
        return image.repeat(times, axis=0).repeat(times, axis=1)
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))


def side_by_side(films: Mapping[str, Path]) -> Iterator[Bytes]:
    """Images of several films together, as long as all go on; each below its text, in about as many columns as rows."""
    columns = ceil(sqrt(len(films))) if len(films) > 2 else len(films)
    width = (WIDTH - GAP * (columns - 1)) // columns
    for images in zip(*(read_film(path) for path in films.values()), strict=False):
        cells = [labelled(scaled(image, width), text) for text, image in zip(films, images, strict=True)]
        cells += [np.full_like(cells[0], PAPER[0]) for _ in range(-len(cells) % columns)]
        rows = [beside(cells[k : k + columns]) for k in range(0, len(cells), columns)]
        yield np.concatenate(rows)
