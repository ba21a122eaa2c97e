"""Codes of colour channels: position on a colour curve, rounded down after a dither that depends on the sub-pixel."""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel
from wall.packets.kernels.plain_body import LARGEST_COLOUR

TOP_CODE = 1535  # of a channel, see colour_curve.py
DARK_BITS = 115 << 23  # of float32 2^-12, where the curve's buckets begin
BUCKET_SHIFT = 16  # float32 bits below those that number a bucket
LOW_32 = np.uint64(0xFFFFFFFF)
ZERO, HALF = np.float32(0.0), np.float32(0.5)


@inline_kernel
def dither_bits(x, y):
    """30 random bits of sub-pixel (x, y), ten for each colour channel: a hash."""
    h = (np.uint64((x << 16) | y) * np.uint64(0x9E3779B1)) & LOW_32
    h ^= h >> np.uint64(15)
    h = (h * np.uint64(0x85EBCA77)) & LOW_32
    h ^= h >> np.uint64(13)
    return np.int64(h)


@inline_kernel
def dither(bits):
    """float32 inside (0, 1), an odd multiple of 1/2048, from the lowest ten bits."""
    return (np.float32(bits & 1023) + HALF) * np.float32(1.0 / 1024.0)


@inline_kernel
def code_of(value, offset, curve):
    """The code of a channel's linear radiance: floor(its position on the curve + offset). curve : ColourCurve"""
    value = min(max(value, ZERO), np.float32(LARGEST_COLOUR))
    bits = max(np.int64(np.float32(value).view(np.int32)) - DARK_BITS, 0)
    code = np.int64(curve.code_of_bucket[bits >> BUCKET_SHIFT])
    code += np.int64(curve.colour_of_code[code + 1, 0] <= value)
    at = (value - curve.colour_of_code[code, 0]) * curve.colour_of_code[code, 1]
    return min(code + np.int64(at + offset), TOP_CODE)


@inline_kernel
def colour_of(code, offset, curve):
    """Linear radiance in the middle of all colours that code_of() takes to this code with this offset."""
    at = np.float32(code) + (HALF - offset)
    at = min(max(at, ZERO), np.float32(TOP_CODE))
    whole = np.int64(at)
    low = curve.colour_of_code[whole, 0]
    return low + (at - np.float32(whole)) * (curve.colour_of_code[whole + 1, 0] - low)
