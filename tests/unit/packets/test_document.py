"""docs/guide/packet_format.md is true: its tables and examples are read from the page and held against the code."""

from __future__ import annotations

import json
import re
import struct
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from packet_examples import batch_of

from wall.core.data import CHANNELS, SAMPLE, Camera, Edits, Event, Framelet, Rect, Samples, StatisticsImage
from wall.packets import control
from wall.packets.framelets import COMPARED, ENCODED, MAX_AREA, PLAIN, POSED, FrameletPart
from wall.packets.kernels import compact_body as kernels
from wall.packets.plain_body import bytes_a_sample
from wall.packets.samples import (
    ADAPTIVE,
    ALWAYS,
    HEADER_BYTES,
    NOISY,
    OPTIONAL_OF_PLAIN,
    RELIGHTABLE,
    WITH_SURFACE,
    Channel,
    decode,
    encode,
)
from wall.roles.early_batches import MOST_BATCHES

PAGE = (Path(__file__).parents[3] / "docs" / "guide" / "packet_format.md").read_text()


def block(kind: str) -> str:
    """The text between ```kind and ```."""
    found = re.search(rf"^```{kind}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    assert found
    return found[1]


def dumped(name: str) -> bytes:
    """The bytes of a hex dump: lines of an offset and up to 16 bytes."""
    data = b""
    for line in block(f"hex {name}").splitlines():
        offset, digits = line.split(maxsplit=1)
        assert int(offset, 16) == len(data)
        data += bytes.fromhex(digits)
    return data


def table(after: str) -> list[tuple[int, str, str]]:
    """(offset, struct type, field) of the first byte table after some words."""
    rows = PAGE[PAGE.index(after) :].split("| offset |", 1)[1].split("\n\n", 1)[0]
    return [(int(o), t, f) for o, t, f in re.findall(r"^\| (\d+) \| (\w+) \| ?(\w*) ?\|", rows, re.MULTILINE)]


def read(rows: list[tuple[int, str, str]], data: bytes) -> dict[str, Any]:
    """The fields of a table, read from bytes; offsets must follow from the types."""
    values: dict[str, Any] = {}
    at = 0
    for offset, kind, field in rows:
        assert offset == at, field
        unpacked = struct.unpack_from("<" + kind, data, offset)
        values[field] = unpacked[0] if len(unpacked) == 1 else unpacked
        at += struct.calcsize("<" + kind)
    values["size"] = at
    return values


def samples_of(rows: list[dict[str, Any]]) -> Samples:
    samples = np.zeros(len(rows), SAMPLE)
    for k, row in enumerate(rows):
        for name, value in row.items():
            samples[k][name] = value
    return samples


EXAMPLE = json.loads(block("json samples"))


def test_the_example_decodes_to_the_values_beside_it() -> None:
    batch = decode(dumped("samples"))
    assert {name: getattr(batch, name) for name in EXAMPLE["header"]} == EXAMPLE["header"]
    assert asdict(batch.rect) == EXAMPLE["rect"]
    assert (batch.samples == samples_of(EXAMPLE["decoded"])).all()


def test_the_example_is_what_its_values_encode_to() -> None:
    batch = batch_of(samples_of(EXAMPLE["sent"]), rect=Rect(**EXAMPLE["rect"]), **EXAMPLE["header"])
    assert encode(batch) == dumped("samples")


def test_the_compact_example_decodes_to_the_values_beside_it_and_is_what_they_encode_to() -> None:
    batch = batch_of(samples_of(EXAMPLE["sent"]), rect=Rect(**EXAMPLE["rect"]), adaptive=True)
    packet = encode(batch)
    assert zstandard.decompress(packet[HEADER_BYTES:]) == dumped("compact")
    came, wanted = decode(packet).samples, samples_of(json.loads(block("json compact")))
    np.testing.assert_allclose(came["radiance"], wanted["radiance"], rtol=1e-6)  # machines round products differently
    assert all((came[name] == wanted[name]).all() for name in ("xy", "depth", "time", "object_id", "change"))


def test_the_example_with_normals_decodes_to_the_values_beside_it_and_is_what_they_encode_to() -> None:
    relightable = json.loads(block("json relightable"))
    sent = [row | more for row, more in zip(EXAMPLE["sent"], relightable["sent"], strict=True)]
    batch = batch_of(samples_of(sent), rect=Rect(**EXAMPLE["rect"]), adaptive=True, relightable=True)
    packet = encode(batch)
    assert zstandard.decompress(packet[HEADER_BYTES:]) == dumped("relightable")
    came, wanted = decode(packet).samples, samples_of(relightable["decoded"])
    assert all((came[name] == wanted[name]).all() for name in ("object_id", "normal", "light_visibility"))


def test_the_channels_and_columns_are_the_document_s() -> None:
    rows = re.findall(r"^\| (\d+) \| (\w+) \| \w+ samples", PAGE, re.MULTILINE)
    assert {name.upper(): int(bit) for bit, name in rows} == {channel.name: channel.value for channel in Channel}
    compact = f"{int(ADAPTIVE)}, {int(RELIGHTABLE)} or {int(NOISY)} in a compact one"
    more = [str(channel.value) for channel in OPTIONAL_OF_PLAIN]
    plain = f"{int(ALWAYS)} in a plain body, with any of {', '.join(more[:-1])} and {more[-1]} added"
    assert f"{plain}; {compact}" in PAGE
    columns = PAGE[PAGE.index("| column |") :].split("\n\n", 1)[0]
    names = re.findall(r"^\| (\w+) \| n \|", columns, re.MULTILINE)
    assert [getattr(kernels, name.upper()) for name in names] == list(range(kernels.SURFACE_COLUMNS))


def test_the_number_of_early_packets_is_the_document_s() -> None:
    assert f"at most {MOST_BATCHES:,} packets wait" in PAGE


def test_the_header_s_byte_table_reads_the_example() -> None:
    data = dumped("samples")
    fields = read(table("## Sample packets"), data)
    assert fields["size"] == HEADER_BYTES == 182
    assert (fields["magic"], fields["version"], fields["kind"], fields["codec"]) == (b"WALL", 8, 1, 0)
    assert (fields["layout"], fields["channels"], fields["objects"]) == (0, WITH_SURFACE, 0)
    assert {name: fields[name] for name in EXAMPLE["header"]} == EXAMPLE["header"]
    assert {name: fields[name] for name in EXAMPLE["rect"]} == EXAMPLE["rect"]
    assert (fields["count"], fields["length"]) == (3, 3 * bytes_a_sample(depths=True, objects=True))
    assert len(data) == fields["size"] + fields["length"]
    assert (fields["depth_base"], fields["depth_bits"]) == (127 + 2, 15)  # 4 = 2^2 and 7.3 share an octave


def test_the_control_header_s_table_reads_the_ping() -> None:
    data = dumped("ping")
    fields = read(table("## Control messages"), data)
    assert control.parse_control(data) == control.Ping(sent=1.5)
    assert control.serialise(control.Ping(sent=1.5)) == data
    assert fields["size"] == control.HEADER_BYTES
    assert (fields["magic"], fields["kind"], fields["length"]) == (b"WALL", control.KIND_PING, len(data) - 16)
    assert fields["version"] == control.VERSION
    assert f"| 4 | B | version | {control.VERSION} |" in PAGE


def test_the_event_table_reads_an_event() -> None:
    camera = Camera(position=(1.0, 2.0, 3.0), world_from_wall=tuple(map(float, range(9))), eye=(0.5, 0.25, -2.0))
    event = Event(
        view=1, camera_event=2, scene_event=3, scene_time=4.5, input_time=5.5, camera=camera, sampler="hilbert",
        paused=True, compare="framed", statistics=True, exposure=-1.5, tone_mapping="aces",
        edits=Edits(7, (("exposure", (2.0, 3.0)),)),
    )  # fmt: skip
    body = control.serialise(event)[control.HEADER_BYTES :]
    fields = read(table("Event (numbers finite"), body)
    assert fields.pop("size") == 223
    assert body[223:] == b"\x08exposure\x02" + struct.pack("<2d", 2.0, 3.0)
    words = {"sampler": b"hilbert", "paused": 1, "compare": b"framed", "statistics": 1, "tone_mapping": 2}
    wanted = asdict(event) | camera_fields(camera) | words
    wanted["edit"] = wanted.pop("edits")["number"]
    wanted.pop("camera")
    assert fields == wanted


def camera_fields(camera: Camera) -> dict[str, Any]:
    return {"position": camera.position, "world_from_wall": camera.world_from_wall, "eye": camera.eye}


def test_the_framelet_table_reads_a_framelet() -> None:
    rect = Rect(x=-5, y=6, width=7, height=8)
    camera = Camera(position=(1.0, 2.0, 3.0), world_from_wall=tuple(map(float, range(9))), eye=(0.5, 0.25, -2.0))
    event = Event(view=3, camera_event=9, scene_event=10, scene_time=2.5, input_time=0.0, camera=camera)
    framelet = Framelet.blank(rect, frozenset({"colour", "depth", "time"}), encoded=True)
    framelet.event, framelet.refreshed_at = event, 4.5
    part = replace(FrameletPart.of(4, framelet, rect, compared=True), index=1, count=3)
    body = control.serialise(part)[control.HEADER_BYTES :]
    fields = read(table("Framelet, a rectangle"), body)
    assert fields.pop("size") == 170 == len(body) - len(part.data)
    channels = 1 << CHANNELS.index("colour") | 1 << CHANNELS.index("depth") | 1 << CHANNELS.index("time")
    numbers = {"camera_event": 9, "scene_event": 10, "scene_time": 2.5, "refreshed_at": 4.5}
    flags = {"channels": channels, "flags": ENCODED | COMPARED | POSED}
    flags |= {"index": 1, "count": 3}
    assert fields == {
        "step": 4,
        "view": 3,
        **asdict(rect),
        **flags,
        **numbers,
        **camera_fields(camera),
        "length": len(part.data),
    }


def test_the_framelet_s_bits_are_the_document_s() -> None:
    row = next(line for line in PAGE.splitlines() if "| B | channels |" in line)
    assert re.findall(r"bit \d (\w+)", row) == list(CHANNELS)
    row = next(line for line in PAGE.splitlines() if "| flags | 1:" in line)
    assert [int(k) for k in re.findall(r"(\d): ", row)] == [ENCODED, COMPARED, POSED, PLAIN]
    assert MAX_AREA == 1 << 25
    assert "width · height at most 2^25" in PAGE


def test_the_statistics_table_reads_a_statistics_image() -> None:
    codes = np.arange(6, dtype=np.uint8).reshape(2, 3)
    statistics_image = StatisticsImage(
        panel=4, compared=True, age=codes, density=codes + 10, rects=np.arange(8, dtype=np.uint16).reshape(2, 4),
        error_reduction=np.array([7, 8], np.uint8),
    )  # fmt: skip
    body = control.serialise(statistics_image)[control.HEADER_BYTES :]
    fields = read(table("StatisticsImage, while a viewer"), body)
    assert fields == {"rank": 0, "panel": 4, "compared": 1, "rows": 2, "columns": 3, "rects": 2, "size": 13}
    rects = b"".join(struct.pack("<H", k) for k in range(8))
    assert body[13:] == bytes(range(6)) + bytes(range(10, 16)) + rects + bytes([7, 8])


def test_every_kind_of_message_is_listed() -> None:
    listed = dict(re.findall(r"^\| (\d+) \| (\w+) \| (?:JSON|struct)", PAGE, re.MULTILINE))
    kinds = {str(kind): cls.__name__ for kind, cls in control._JSON_KINDS.items()}
    structs = {
        control.KIND_EVENT: "Event",
        control.KIND_FRAMELET: "Framelet",
        control.KIND_STATISTICS_IMAGE: "StatisticsImage",
    }
    assert listed == kinds | {str(kind): name for kind, name in structs.items()}


def test_the_script_on_the_page_compiles() -> None:
    compile(block("python"), "packet_format.md", "exec")
