"""Bytes a second to expect on an edge of the graph: upper bounds, before compression.

A still view sends less, down to nothing: samplers stop when the image is complete, and only changes are sent.
"""

from __future__ import annotations

from wall.core.data import Channels
from wall.packets import plain_body
from wall.packets.samples import HEADER_BYTES

COMPACT_BYTES_A_SAMPLE = 6.5  # adaptive, header included: the limit of `adaptive_bytes`, docs/guide/measuring.md
ENCODED_BYTES = 3  # a pixel of 8-bit sRGB
LINEAR_BYTES = 12  # a pixel of three float32
CHANNEL_BYTES = 4  # a pixel of any other channel: float32 or uint32


def bytes_a_sample(method: str, samples_per_batch: int, *, depths: bool, objects: bool) -> float:
    """Bytes that a sample takes on the wire, its share of the packet's header included.

    Parameters
    ----------
    method : sampling method; "adaptive" sends the compact body, all others the plain one
    samples_per_batch : samples of one packet
    depths, objects : whether plain samples bring them, see Graph.fields_of
    """
    if method == "adaptive":
        return COMPACT_BYTES_A_SAMPLE
    return plain_body.bytes_a_sample(depths=depths, objects=objects) + HEADER_BYTES / samples_per_batch


def samples_traffic(ranks: int, samples_per_s: float, sample_bytes: float) -> float:
    """Bytes/s of so many ranks that trace `samples_per_s` each, in packets of `sample_bytes` a sample."""
    return ranks * samples_per_s * sample_bytes


def framelet_traffic(pixels: int, channels: Channels, *, encoded: bool, refresh_hz: float) -> float:
    """Bytes/s of framelets that are sent whole at every refresh.

    Parameters
    ----------
    pixels : of the framelet
    channels : that it has, "colour" among them
    encoded : colour is 8-bit sRGB, not linear float32
    refresh_hz : refreshes a second
    """
    colour = ENCODED_BYTES if encoded else LINEAR_BYTES
    return pixels * (colour + CHANNEL_BYTES * len(channels - {"colour"})) * refresh_hz


def si(value: float, unit: str) -> str:
    """12345678 as "12.3 MB/s": three digits, SI prefix. Negative values do not occur."""
    for prefix, size in (("T", 1e12), ("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= 0.9995 * size:  # 999.6 k rounds to 1000 k, which is 1 M
            return f"{_three(value / size)} {prefix}{unit}"
    return f"{_three(value)} {unit}"


def _three(value: float) -> str:
    """A number with three significant digits, without trailing zeros."""
    digits = 2 if value < 9.995 else 1 if value < 99.95 else 0
    text = f"{value:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
