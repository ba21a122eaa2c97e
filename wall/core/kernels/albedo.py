"""The albedo of a sample in 24 bits: the square roots of red, green and blue, 8 bits each, red lowest.

Light is radiance over the *coded* albedo, so that both give the radiance back exactly. It is coded from FLOOR on:
what a darker surface reflects, a highlight on black paint say, is not its albedo's. Only where light is replaced by its
mean over neighbours does the rounding show, by at most half a code: 1/510 of the square root.
"""

from __future__ import annotations

import math

import numpy as np

from wall.core.jit import inline_kernel

FLOOR = np.float32(0.04)
CODES = np.float32(255.0)
WHITE = np.uint32(0xFFFFFF)  # of what shines by itself: its light is its radiance
BYTE = np.uint32(255)


@inline_kernel
def pack_albedo(r, g, b):
    """The code of an albedo, float32 each, clipped to FLOOR..1."""
    return code_of(r) | code_of(g) << np.uint32(8) | code_of(b) << np.uint32(16)


@inline_kernel
def code_of(share):
    """The code of one channel."""
    return np.uint32(np.int64(CODES * math.sqrt(min(max(share, FLOOR), np.float32(1.0))) + np.float32(0.5)))


@inline_kernel
def unpack_albedo(code):
    """Red, green and blue, float32, of a code."""
    r, g, b = code & BYTE, code >> np.uint32(8) & BYTE, code >> np.uint32(16) & BYTE
    return share_of(r), share_of(g), share_of(b)


@inline_kernel
def share_of(code):
    """One channel of a code; of codes that pack_albedo never gives, at least 1/255 squared."""
    root = np.float32(max(code, np.uint32(1))) * np.float32(1.0 / 255.0)
    return root * root


@inline_kernel
def light_of(sample):
    """Radiance over albedo of a SAMPLE of paths, red, green and blue, float32."""
    r, g, b = unpack_albedo(sample["albedo"])
    return sample["radiance"][0] / r, sample["radiance"][1] / g, sample["radiance"][2] / b
