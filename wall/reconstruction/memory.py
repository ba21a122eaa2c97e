"""What a reconstruction takes of memory, known before it is made: the sizes of the arrays that it will allocate.

The system gives memory where it is first written to. Stores are written as samples come, so an image takes what is
worked out here once as many samples are stored as are kept. Room for more of them is hardly touched.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL, capacity_for
from wall.deepbuffer.kernels.evict import AGES
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.store import PixelHistory, SampleStore
from wall.reconstruction.kernels import edge_filter, light_change, light_field
from wall.reconstruction.pyramid import pyramid_sizes

FLOAT = 4  # bytes
# bytes of a pixel: three bounds, the image and what of it is resolved, twice the sums of splats, the list of holes
OF_A_PIXEL = FLOAT * (3 + 3 + 3 + 4 + 4 + 1)
OF_A_SETTLED = 2 * FLOAT + 1  # of a pixel: the range of its depths, whether it shows a mirror
OF_A_SAMPLE = FLOAT * (1 + 1 + 1)  # of a sample beside the stores: its weight, and two lists of indices
OF_A_LIGHT = FLOAT * (light_field.ROWS + 3 * light_field.LIGHTS + 2 * light_field.SPREADS)  # of a pixel, with borders
OF_SUMS = FLOAT * (light_field.SUMS + 1)  # of a pixel: sums of its light, and its surface


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What samples bring, and how many of them are kept."""

    lit: bool = False  # they are lit anew
    noisy: bool = False  # their noise is filtered
    detects_change: bool = False
    settles: bool = False  # tiles may be still though something moves
    samples_per_pixel: float = SAMPLES_PER_PIXEL
    threads: int = 1


def reconstruction_bytes(width: int, height: int, kept: Kept, *, room: bool = False) -> int:
    """Bytes of the arrays of a Reconstruction of so many pixels; with `room`, of all that is allocated."""
    stored = int(kept.samples_per_pixel * width * height)
    capacity = capacity_for(stored, width, height) if room else stored
    of_a_sample = 2 * _bytes(SampleStore.of(1, lit=kept.lit, noisy=kept.noisy)) + OF_A_SAMPLE
    if kept.threads > 1:
        of_a_sample += FLOAT * kept.threads
    tiles = -(-height // TILE) * -(-width // TILE)
    of_a_tile = _bytes(PixelHistory.of(TILE, TILE, detects_change=kept.detects_change, noisy=kept.noisy))
    levels = 4 * FLOAT * sum(rows * columns for rows, columns in pyramid_sizes(height, width))
    of_a_pixel = OF_A_PIXEL + OF_A_SETTLED * kept.settles
    filtered = _lighting_bytes(width, height) if kept.noisy else 0
    return capacity * of_a_sample + tiles * of_a_tile + of_a_pixel * width * height + levels + FLOAT * AGES + filtered


def dynamic_bytes(width: int, height: int, coarsest: int, kept: Kept) -> int:
    """Bytes of a DynamicResolution's images of every scale up to the coarsest: it keeps those that it has left."""
    scales = [1 << k for k in range(coarsest.bit_length())]
    return sum(reconstruction_bytes(max(1, width // k), max(1, height // k), kept) for k in scales)


def _lighting_bytes(width: int, height: int) -> int:
    """Bytes of a light field."""
    rows, columns = edge_filter.padded(height, width)
    tiles = -(-height // light_change.LIGHT_TILE) * -(-width // light_change.LIGHT_TILE)
    changes = 2 * FLOAT * (light_change.COLUMNS + 4)
    return OF_A_LIGHT * rows * columns + OF_SUMS * width * height + changes * tiles


def _bytes(arrays: Iterable[Any]) -> int:
    return sum(array.nbytes for array in arrays)
