"""Batches survive the wire: the header exactly, samples within the stated bounds; what cannot be carried is refused."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from packet_examples import batch_of, batches, check_bounds, check_sane, plain_samples

from wall.core.data import SAMPLE, Batch, Rect
from wall.core.errors import LocalProtocolError
from wall.packets.samples import HEADER_BYTES, TOO_BRIGHT, Codec, decode, encode, is_samples

HEADER_FIELDS = [name for name in Batch.__dataclass_fields__ if name != "samples"]


@given(batch=batches())
@settings(max_examples=150, deadline=None)
def test_any_batch_comes_back_within_the_stated_bounds(batch: Batch) -> None:
    came = decode(encode(batch))
    assert [getattr(came, name) for name in HEADER_FIELDS] == [getattr(batch, name) for name in HEADER_FIELDS]
    check_bounds(batch, came)
    check_sane(came)


@pytest.mark.parametrize("codec", Codec)
@pytest.mark.parametrize("n", [0, 1, 2, 1024])
def test_every_codec_carries_the_same_samples(codec: Codec, n: int) -> None:
    batch = batch_of(plain_samples(n))
    assert (decode(encode(batch, codec)).samples == decode(encode(batch)).samples).all()


def test_a_packet_of_the_most_samples_comes_back(compiled_only: None) -> None:
    batch = batch_of(plain_samples(65536))
    check_bounds(batch, decode(encode(batch, Codec.LZ4)))


@pytest.mark.parametrize(
    ("depths", "objects", "size"), [(True, True, 12), (True, False, 10), (False, True, 10), (False, False, 8)]
)
def test_a_sample_takes_8_bytes_before_compression_and_2_for_its_depth_and_its_object(
    depths: bool, objects: bool, size: int
) -> None:
    samples = plain_samples(100)
    packet = encode(batch_of(samples, depths=depths, objects=objects))
    assert len(packet) == HEADER_BYTES + 100 * size
    came = decode(packet).samples
    assert (np.isinf(came["depth"]) == (np.isinf(samples["depth"]) if depths else True)).all()
    assert (came["object_id"] == (samples["object_id"] if objects else 0)).all()


@pytest.mark.parametrize("adaptive", [False, True])
def test_samples_with_more_light_than_packets_carry_are_counted(adaptive: bool) -> None:
    samples, counters = plain_samples(6), Counter[str]()
    samples["radiance"][0], samples["radiance"][1] = 65408.0, (0.0, 0.0, 65409.0)
    samples["radiance"][2:4] = 1e30
    packet = encode(batch_of(samples, adaptive=adaptive), counters=counters)
    encode(batch_of(plain_samples(6), adaptive=adaptive), counters=counters)
    assert counters == {TOO_BRIGHT: 3}
    assert decode(packet).samples["radiance"].max() == pytest.approx(65408.0, rel=0.0045)


@pytest.mark.parametrize("codec", Codec)
def test_object_ids_of_32_bits_cost_4_bytes_for_each_object_of_the_packet(codec: Codec) -> None:
    samples = plain_samples(100)
    samples["object_id"] = np.arange(100) % 7 + 65529  # 65,535 is the last that needs no table
    direct = encode(batch_of(samples), codec)
    samples["object_id"] += 1
    tabled = encode(batch_of(samples), codec)
    if codec == Codec.NONE:
        assert (len(direct), len(tabled)) == (HEADER_BYTES + 1200, HEADER_BYTES + 1200 + 4 * 7)
    assert (decode(direct).samples["object_id"] == samples["object_id"] - 1).all()
    assert (decode(tabled).samples["object_id"] == samples["object_id"]).all()


def test_a_packet_can_be_read_from_a_view_of_a_larger_buffer() -> None:
    packet = encode(batch_of(plain_samples(9)))
    came = decode(memoryview(b"before" + packet + b"after")[6:-5])
    assert (came.samples == decode(packet).samples).all()


def test_decoding_the_same_packet_twice_gives_the_same_batch() -> None:
    packet = encode(batch_of(plain_samples(50)))
    assert (decode(packet).samples == decode(packet).samples).all()


def test_samples_of_a_strided_or_read_only_array_are_encoded_alike() -> None:
    samples = plain_samples(64)
    strided, fixed = np.repeat(samples, 2)[::2], samples.copy()
    fixed.flags.writeable = False
    assert encode(batch_of(strided)) == encode(batch_of(samples)) == encode(batch_of(fixed))


def test_only_sample_packets_look_like_sample_packets() -> None:
    packet = encode(batch_of(plain_samples(1)))
    assert is_samples(packet)
    assert not is_samples(b"WALL\x01\x02" + packet[6:])
    assert not is_samples(b"")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("xy", (-0.01, 5.0)),
        ("xy", (480.0, 5.0)),
        ("xy", (481.5, 5.0)),  # would fit 14 bits at 5 sub-pixel bits
        ("xy", (5.0, 270.0)),
        ("xy", (np.nan, 5.0)),
        ("xy", (5.0, 1e30)),
        ("radiance", (np.nan, 0.0, 0.0)),
        ("radiance", (0.0, np.inf, 0.0)),
        ("radiance", (0.0, 0.0, -np.inf)),
        ("depth", -1.0),
        ("depth", np.nan),
        ("depth", -np.inf),
        ("time", -1e-6),
        ("time", np.nan),
        ("time", np.inf),
        ("time", 1e6),
    ],
)
def test_a_sample_that_cannot_be_carried_is_refused(field: str, value: Any) -> None:
    samples = plain_samples(5)
    samples[3][field] = value
    with pytest.raises(LocalProtocolError, match="rank 2 packet 812: "):
        encode(batch_of(samples))


@pytest.mark.parametrize(
    "wrong",
    [
        {"view": 65536}, {"panel": -1}, {"rank": 65536}, {"sequence": 2**64}, {"camera_event": 2**60},
        {"scene_event": -1}, {"frame": 2**60}, {"frame_samples": -1}, {"skipped": 2**32}, {"base_time": np.nan},
        {"base_time": np.inf}, {"blend": 0.0}, {"blend": 1.5}, {"blend": np.nan}, {"blend": 1e-60},
        {"rect": Rect(x=0, y=0, width=4097, height=9)}, {"rect": Rect(x=0, y=0, width=9, height=0)},
        {"rect": Rect(x=-5, y=0, width=480, height=270)}, {"rect": Rect(x=65536, y=0, width=9, height=9)},
    ],
)  # fmt: skip
def test_a_header_that_does_not_fit_its_fields_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(LocalProtocolError, match=r"rank -?[0-9]+ packet [0-9]+: "):
        encode(replace(batch_of(np.zeros(0, SAMPLE)), **wrong))


def test_more_samples_than_a_packet_holds_are_refused() -> None:
    with pytest.raises(LocalProtocolError, match="65537 samples"):
        encode(batch_of(np.zeros(65537, SAMPLE)))
