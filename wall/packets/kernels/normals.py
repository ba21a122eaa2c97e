"""Codes of the components of octahedral normals."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel

NORMAL_CODES = 31  # to either side of 0; 127 at both ends


@inline_kernel
def normal_code(component):
    """Nearest code of an int8 component; there are no ties."""
    return (2 * NORMAL_CODES * np.int64(component) + 127) // 254


@inline_kernel
def normal_of(code):
    """The component of a code, within 2 of 127 of what was coded."""
    return (254 * np.int64(code) + NORMAL_CODES) // (2 * NORMAL_CODES)
