"""General compressors of packet bodies, and what they are trusted with: never more bytes than were promised."""

from __future__ import annotations

from enum import IntEnum

import lz4.block
import zstandard

from wall.core.errors import RemoteProtocolError

ZSTD_LEVEL = 1  # higher levels gain 3 % and cost three times as much


class Codec(IntEnum):
    """How a body is compressed."""

    NONE = 0
    LZ4 = 1
    ZSTD = 2


def compress(body: memoryview, codec: Codec) -> bytes:
    """The compressed bytes of a body; zstd frames state their size."""
    if codec == Codec.LZ4:
        return bytes(lz4.block.compress(body, store_size=False))
    if codec == Codec.ZSTD:
        return zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress(body)
    return bytes(body)


def expand(body: memoryview, codec: int, size: int, where: str) -> bytes | memoryview:
    """The body before compression: exactly `size` bytes, never more is allocated. Raises RemoteProtocolError."""
    try:
        if codec == Codec.NONE:
            data: bytes | memoryview = body
        elif codec == Codec.LZ4:
            data = lz4.block.decompress(body, uncompressed_size=size)
        elif codec == Codec.ZSTD:
            data = expand_at_most(body, size, where)
        else:
            raise RemoteProtocolError(f"{where}: unknown codec {codec}; known: 0 none, 1 lz4, 2 zstd")
    except (lz4.block.LZ4BlockError, ValueError) as error:
        raise RemoteProtocolError(f"{where}: body does not decompress ({error})") from error
    if len(data) != size:
        raise RemoteProtocolError(f"{where}: body has {len(data)} bytes, its samples need {size}")
    return data


def expand_at_most(body: memoryview, size: int, where: str) -> bytes:
    """The bytes of a zstd frame that states its size, refused above `size` before any is allocated.

    Raises RemoteProtocolError.
    """
    try:
        stated = zstandard.frame_content_size(body)
        if not 0 <= stated <= size:
            raise RemoteProtocolError(f"{where}: body expands to {stated} bytes, its samples need at most {size}")
        return zstandard.ZstdDecompressor().decompress(body, max_output_size=stated, allow_extra_data=False)
    except (zstandard.ZstdError, ValueError) as error:
        raise RemoteProtocolError(f"{where}: body does not decompress ({error})") from error
