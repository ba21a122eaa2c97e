"""How light becomes display values: an exposure, then a curve that brings light of any strength into what is shown.

`none` clips at 1. The other curves are of the field: `reinhard`, x / (1 + x) of each channel (Reinhard et al.,
"Photographic Tone Reproduction for Digital Images", 2002, eq. 3); `aces`, the fit of the filmic curve of ACES by
K. Narkowicz, "ACES Filmic Tone Mapping Curve", 2016, of each channel; `khronos_neutral`, the Khronos PBR Neutral tone
mapper (2024): colours below 0.8 stay as they are but for 0.04 of reflected light, brighter ones go to white.

All map 0 to 0, nothing above 1, and more light of a colour never to less.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

ToneMapping: TypeAlias = Literal["none", "reinhard", "aces", "khronos_neutral"]
TONE_MAPPINGS: tuple[str, ...] = get_args(ToneMapping)
CODES = {name: code for code, name in enumerate(TONE_MAPPINGS)}  # those of kernels, shaders and packets
WHITES = (1.0, 1e30, 7.25, 1e30)  # from which light on each curve shows full white; 1e30: from none on


class Tone(NamedTuple):
    """Exposure, stops: light times 2^stops is mapped; and the curve."""

    stops: float = 0.0
    mapping: str = "none"

    @property
    def gain(self) -> np.float32:
        """What light is multiplied by; 1 at 0 stops, exactly."""
        return np.float32(2.0**self.stops)

    @property
    def code(self) -> int:
        """The curve's number, as kernels take it."""
        return CODES[self.mapping]


AS_IT_IS = Tone()


def tone_mapped(light: NDArray[np.floating], mapping: str) -> NDArray[np.float32]:
    """Light of display values from exposed light (..., 3), as float32 in [0, 1]; under `none` light is not clipped."""
    from wall.core.kernels import tone_mapping as kernels  # whose compiler not every process needs

    mapped = np.array(light, np.float32, order="C")
    kernels.map_row(mapped.reshape(-1), CODES[mapping])
    return mapped
