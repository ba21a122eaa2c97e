"""Keep the newest sample of every pixel of a panel, for displays that make the image themselves.

Woolley, Luebke, Watson and Dayal, "The Ultimate Display: Where Will All the Pixels Come From?", 2005, end with a
display that takes in streams of frameless samples and reconstructs the image itself. Such a display gets here the
samples that came since it last got some: of each pixel the newest, so that one that is slow misses nothing, and what
waits for it is never more than the panel.

A sample's light is sent as three half floats. Of the halves around a value that one is taken which shows as the byte
that the wall itself shows.
"""

from __future__ import annotations

import itertools
import threading
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import CURVE_STEPS, srgb_curve
from wall.core.data import Float32
from wall.core.tone_mapping import AS_IT_IS, Tone, tone_mapped
from wall.display.base import PanelSamples

_versions = itertools.count(1)  # of all stores: one that takes another's place is newer than it
INFINITE = 0x7C00  # bits of the half float above all others: those of positive ones grow with their value


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of distinct pixels, in the order of these."""

    pixels: NDArray[np.uint32]  # (n,) y * width + x
    light: NDArray[np.uint16]  # (n, 3) bits of half floats, linear RGB before exposure
    tone: Tone  # how it is shown


class SampleStore:
    """`take` what came, give what came `since` a version. Both may be called by threads of their own."""

    def __init__(self, width: int, height: int) -> None:
        self.version = 0  # grows with every change
        self._tone = AS_IT_IS
        self._versions = np.zeros(height * width, np.int64)  # of each pixel's sample
        self._light = np.zeros((height * width, 3), np.uint16)
        self._lock = threading.Lock()

    def take(self, samples: PanelSamples, rgb: NDArray[np.uint8]) -> None:
        """Keep new samples. rgb : (h, w, 3) uint8 sRGB, what the wall shows with them."""
        if len(samples.pixels) == 0 and samples.tone == self._tone:
            return
        light = halves(samples.radiance, rgb.reshape(-1, 3)[samples.pixels], samples.tone)
        with self._lock:
            self.version, self._tone = next(_versions), samples.tone
            self._light[samples.pixels] = light
            self._versions[samples.pixels] = self.version

    def since(self, version: int | None) -> tuple[int, Samples]:
        """The newest version, and the samples that are newer than `version`; None: every pixel."""
        with self._lock:
            newer = slice(None) if version is None else np.flatnonzero(self._versions > version)
            pixels = np.arange(len(self._light))[newer]
            return self.version, Samples(pixels.astype(np.uint32), self._light[pixels], self._tone)


def halves(radiance: Float32, codes: NDArray[np.uint8], tone: Tone) -> NDArray[np.uint16]:
    """Bits of half floats that differ from a radiance by less than one step and, under `tone`, show as `codes`.

    A code is 4 or more steps wide: where rounding leaves it, the next half lies in it. Both arrays are (n, 3). Where a
    channel is shown by what the others are, halves are the nearest, and show as a code beside at times.
    """
    bits = np.minimum(np.maximum(radiance, 0.0), np.float32(65_504.0)).astype(np.float16).view(np.uint16)
    if tone.mapping == "khronos_neutral":
        return bits
    shown = codes_of_halves(float(tone.gain), tone.mapping)[bits]
    return bits + (shown < codes).astype(np.uint16) - ((shown > codes) & (bits > 0)).astype(np.uint16)


@lru_cache(maxsize=4)
def codes_of_halves(gain: float, mapping: str = "none") -> NDArray[np.uint8]:
    """(31745,) uint8: what half floats from 0 to infinity show as, by their bits; see operators.kernels.encode_row.

    mapping : of each channel by itself, see core.tone_mapping
    """
    light = np.arange(INFINITE + 1, dtype=np.uint16).view(np.float16).astype(np.float32)
    with np.errstate(over="ignore"):
        exposed = np.float32(gain) * light
    exposed = np.minimum(tone_mapped(exposed, mapping), np.float32(1.0))
    codes: NDArray[np.uint8] = srgb_curve()[(np.sqrt(exposed) * np.float32(CURVE_STEPS) + np.float32(0.5)).astype(int)]
    return codes
