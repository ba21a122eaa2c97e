"""Bytes that are no packet raise RemoteProtocolError and nothing else; bytes that are one can harm nobody."""

from __future__ import annotations

import struct
import tracemalloc

import lz4.block
import pytest
import zstandard
from packet_examples import CHECKSUM_AT, HEADER, LENGTH_AT, batch_of, check_sane, plain_samples, resealed

from wall.core.data import Rect
from wall.core.errors import RemoteProtocolError
from wall.packets.samples import HEADER_BYTES, Codec, decode, encode

COUNT_AT, OBJECTS_AT, CODEC_AT = 82, 86, 6
PACKETS = {codec: encode(batch_of(plain_samples(2)), codec) for codec in Codec}
BARE = {codec: encode(batch_of(plain_samples(2), depths=False, objects=False), codec) for codec in Codec}
CHANNELS_AT = 8


def refused_or_sane(data: bytes) -> bool:
    """Whether a packet was accepted; then it must be harmless. Any other exception fails the test."""
    try:
        batch = decode(data)
    except RemoteProtocolError:
        return False
    check_sane(batch)
    return True


def test_the_header_has_the_size_that_these_tests_poke_at() -> None:
    packet = PACKETS[Codec.NONE]
    assert HEADER_BYTES == HEADER
    assert struct.unpack_from("<I", packet, COUNT_AT) == (2,)
    assert resealed(packet) == packet


@pytest.mark.parametrize("codec", Codec)
def test_a_packet_cut_anywhere_is_refused(codec: Codec) -> None:
    packet = PACKETS[codec]
    for length in range(len(packet)):
        with pytest.raises(RemoteProtocolError):
            decode(packet[:length])


@pytest.mark.parametrize("codec", Codec)
def test_every_flipped_bit_is_noticed(codec: Codec) -> None:
    packet = PACKETS[codec]
    for bit in range(8 * len(packet)):
        flipped = bytearray(packet)
        flipped[bit // 8] ^= 1 << bit % 8
        with pytest.raises(RemoteProtocolError):
            decode(bytes(flipped))


def test_bytes_after_the_packet_are_refused() -> None:
    with pytest.raises(RemoteProtocolError, match="header promises"):
        decode(PACKETS[Codec.NONE] + b"\0")


@pytest.mark.parametrize("channels", [*range(11), 15, 19, 23, 27, 43, 1024 | 11, 543])
@pytest.mark.parametrize("codec", Codec)
def test_a_packet_with_other_channels_than_its_body_has_is_refused(codec: Codec, channels: int) -> None:
    """A bare body's are 11: position, radiance, time. A compressed body may be of any length."""
    changed = bytearray(BARE[codec])
    struct.pack_into("<H", changed, CHANNELS_AT, channels)
    with pytest.raises(RemoteProtocolError):
        decode(resealed(changed))


def test_a_table_of_objects_that_are_not_sent_is_refused() -> None:
    changed = bytearray(BARE[Codec.NONE] + bytes(4))
    struct.pack_into("<I", changed, OBJECTS_AT, 1)
    with pytest.raises(RemoteProtocolError, match="without the channel of objects"):
        decode(resealed(changed))


@pytest.mark.parametrize("packets", [PACKETS, BARE], ids=["whole", "bare"])
@pytest.mark.parametrize("codec", Codec)
def test_any_value_of_any_byte_under_a_valid_checksum_is_refused_or_harmless(
    codec: Codec, packets: dict[Codec, bytes]
) -> None:
    packet, accepted = packets[codec], 0
    for offset in [*range(LENGTH_AT), *range(LENGTH_AT + 4, CHECKSUM_AT), *range(HEADER, len(packet))]:
        for value in (0, 1, 2, 0x3F, 0x40, 0x7F, 0x80, 0xC0, 0xFE, 0xFF):
            changed = bytearray(packet)
            changed[offset] = value
            accepted += refused_or_sane(resealed(changed))
    assert accepted > 100  # most header fields may hold anything: the test looks at both outcomes


@pytest.mark.parametrize(
    ("offset", "layout", "value"),
    [
        (16, "B", 255), (17, "B", 7), (17, "B", 16), (22, "H", 0), (22, "H", 4097), (24, "H", 0), (24, "H", 65535),
        (50, "d", float("nan")), (50, "d", float("inf")), (58, "f", -1.0), (58, "f", float("nan")), (58, "f", 1e6),
        (62, "f", 0.0), (62, "f", 1.5), (62, "f", float("nan")), (COUNT_AT, "I", 1), (COUNT_AT, "I", 3),
        (COUNT_AT, "I", 65537), (COUNT_AT, "I", 2**32 - 1), (OBJECTS_AT, "I", 1), (OBJECTS_AT, "I", 2**32 - 1),
        (CODEC_AT, "B", 3), (CODEC_AT, "B", 1), (4, "B", 6), (4, "B", 9), (7, "B", 1), (7, "B", 2), (8, "H", 63),
        (8, "H", 1 << 8 | 31), (94, "d", float("nan")), (102, "d", float("inf")), (126, "d", float("nan")),
        (126, "d", 1.0 + 2e-6), (126, "d", 0.0), (150, "d", 1.0), (150, "d", 1e300), (34, "Q", 2**60),
        (42, "Q", 2**64 - 1), (66, "Q", 2**60), (170, "Q", 2**60),
        (158, "f", float("nan")), (166, "f", float("inf")),
    ],
)  # fmt: skip
def test_a_field_out_of_its_range_is_refused_though_the_checksum_fits(offset: int, layout: str, value: float) -> None:
    changed = bytearray(PACKETS[Codec.NONE])
    struct.pack_into("<" + layout, changed, offset, value)
    with pytest.raises(RemoteProtocolError):
        decode(resealed(changed))


def test_a_position_outside_the_rectangle_is_refused() -> None:
    changed = bytearray(PACKETS[Codec.NONE])
    struct.pack_into("<H", changed, HEADER + 8, 480 << 5)  # x of sample 0: pixel 480 of 480
    with pytest.raises(RemoteProtocolError, match="not 2 samples inside"):
        decode(resealed(changed))


def test_an_index_beyond_the_table_of_objects_is_refused() -> None:
    samples = plain_samples(2)
    samples["object_id"] = 70_000, 80_000
    changed = bytearray(encode(batch_of(samples)))
    struct.pack_into("<H", changed, HEADER + 20, 2)  # of sample 0: two objects
    with pytest.raises(RemoteProtocolError, match="not 2 samples inside"):
        decode(resealed(changed))


def test_a_position_that_rounds_up_to_the_far_edge_is_refused() -> None:
    """At 40,000 px float32 steps by 1/256: the last of 2^14 sub-pixel steps of one pixel is the next pixel."""
    rect = Rect(x=40000, y=0, width=1, height=1)
    samples = plain_samples(1)
    samples["xy"] = 40000.0, 0.5
    changed = bytearray(encode(batch_of(samples, rect=rect)))
    struct.pack_into("<H", changed, HEADER + 4, 0x3FFF)
    with pytest.raises(RemoteProtocolError, match="inside its rectangle"):
        decode(resealed(changed))


@pytest.mark.parametrize("body", [b"", b"\0", b"\xff" * 20, b"(\xb5/\xfd", b"(\xb5/\xfd\x00\x58"])
@pytest.mark.parametrize("codec", [Codec.LZ4, Codec.ZSTD])
def test_a_body_that_does_not_decompress_is_refused(codec: Codec, body: bytes) -> None:
    with pytest.raises(RemoteProtocolError, match="rank 2 packet 812: body"):
        decode(resealed(PACKETS[codec][:HEADER] + body))


@pytest.mark.parametrize("size", [0, 23, 25, 10_000_000])
def test_a_compressed_body_of_another_size_is_refused(size: int) -> None:
    bodies = {
        Codec.LZ4: lz4.block.compress(bytes(size), store_size=False),
        Codec.ZSTD: zstandard.ZstdCompressor().compress(bytes(size)),
    }
    for codec, body in bodies.items():
        with pytest.raises(RemoteProtocolError):
            decode(resealed(PACKETS[codec][:HEADER] + body))


def test_a_zstd_body_that_hides_its_size_or_trails_bytes_is_refused() -> None:
    plain = PACKETS[Codec.NONE][HEADER:]
    hidden = zstandard.ZstdCompressor(write_content_size=False).compress(plain)
    trailed = zstandard.ZstdCompressor().compress(plain) + b"more"
    for body in (hidden, trailed):
        with pytest.raises(RemoteProtocolError):
            decode(resealed(PACKETS[Codec.ZSTD][:HEADER] + body))


@pytest.mark.parametrize("codec", [Codec.LZ4, Codec.ZSTD])
def test_a_decompression_bomb_never_takes_memory(codec: Codec) -> None:
    bomb = bytes(1 << 28)
    body = lz4.block.compress(bomb, store_size=False) if codec == Codec.LZ4 else zstandard.compress(bomb)
    packet = resealed(PACKETS[codec][:HEADER] + body)
    del bomb, body
    tracemalloc.start()
    try:
        with pytest.raises(RemoteProtocolError):
            decode(packet)
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()
