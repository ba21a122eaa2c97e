"""Radiance pictures (.hdr) as other programs write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wall.core.data import Float32


def write_hdr(path: Path, image: Float32) -> None:
    """Writes (h, w, 3) float32, finite and not negative, as flat scanlines: each value within 1/256 of the brightest
    of its three."""
    brightest = np.asarray(image, np.float64).max(axis=-1, keepdims=True)
    _, exponent = np.frexp(brightest)
    mantissas = np.floor(image * np.ldexp(1.0, 8 - exponent))
    rgbe = np.concatenate([mantissas, np.broadcast_to(exponent + 128, brightest.shape)], axis=-1)
    rgbe[brightest[..., 0] < 1e-32] = 0.0
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {image.shape[0]} +X {image.shape[1]}\n"
    path.write_bytes(header.encode() + np.clip(rgbe, 0, 255).astype(np.uint8).tobytes())
