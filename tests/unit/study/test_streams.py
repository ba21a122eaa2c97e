"""Images as messages: what comes out, what is sent, what it adds up to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from wall.config.loading import loads
from wall.core.errors import RunError
from wall.roles.plan import make_layout, make_plan
from wall.study.quality import methods_streams
from wall.study.quality.method import Setup
from wall.study.quality.methods_adaptive import AdaptiveMethod
from wall.study.quality.methods_streams import StreamMethod
from wall.study.quality.metrics import display_values
from wall.study.quality.streams import (
    H264,
    TILE,
    Bytes,
    Jpeg,
    Raw,
    Stream,
    Tiles,
    filtered,
    jpeg_tiles,
    restored,
    zstd_tiles,
)
from wall.tracing.tracer_scene import make_tracer_scene

SIZE = (70, 50)  # of no whole number of tiles
SCENE = """\
version: 1
scene: {source: gallery}
wall: {grid: {columns: 1, rows: 1, pixels: [48, 32], size: [0.3, 0.2]}}
views:
  - camera: {position: [2.6, 3, 7.1], target: [0, 0.6, -0.3], fov: 42}
    path: {type: orbit, period_s: 6}
graph: {preset: sort-first, sinks: [png]}
"""
RATE, REFRESH_HZ = 20_000.0, 60.0
JPEG_CODES = 6.0  # RMS that quality 90 with colour at half resolution may add to a smooth image
H264_CODES = 6.0  # RMS, at rate factor 18


@pytest.fixture
def smooth() -> Bytes:
    """Slow waves of every colour."""
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    planes = [128 + 100 * np.sin(x / a + y / b) for a, b in ((9, 17), (14, 8), (21, 13))]
    return np.stack(planes, axis=2).astype(np.uint8)


@pytest.fixture
def noise(random_numbers: np.random.Generator) -> Bytes:
    return random_numbers.integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)


@pytest.fixture(scope="module")
def setup() -> Setup:
    plan = make_plan(make_layout(loads(SCENE)))
    return Setup(plan=plan, tracer_scene=make_tracer_scene(plan.scene), rate=RATE, refresh_hz=REFRESH_HZ, seed=1)


def through(stream: Stream, image: Bytes) -> Bytes:
    return stream.decode(stream.encode(image))


def off(a: Bytes, b: Bytes) -> float:
    """RMS difference in 8-bit codes."""
    return float(np.sqrt(np.mean((a.astype(np.float64) - b) ** 2)))


def test_raw_images_come_out_as_they_went_in(noise: Bytes) -> None:
    assert np.array_equal(through(Raw(SIZE), noise), noise)
    assert len(Raw(SIZE).encode(noise)) == 3 * SIZE[0] * SIZE[1]


def test_filter_of_tiles_is_undone_exactly(random_numbers: np.random.Generator) -> None:
    tiles = random_numbers.integers(0, 256, (3, TILE, TILE, 3), np.uint8)
    assert np.array_equal(restored(filtered(tiles)), tiles)


def test_filter_leaves_little_of_a_grey_ramp() -> None:
    tiles = np.broadcast_to(np.arange(TILE, dtype=np.uint8)[None, None, :, None], (1, TILE, TILE, 3))
    planes = filtered(tiles)
    assert not planes[0].any()
    assert set(planes[1, 0, :, 1:].ravel()) == {1}
    assert not planes[2].any()


def test_lossless_tiles_are_lossless_image_after_image(noise: Bytes, random_numbers: np.random.Generator) -> None:
    stream = Tiles(SIZE, zstd_tiles())
    for _ in range(3):
        assert np.array_equal(through(stream, noise), noise)
        noise = noise.copy()
        noise[random_numbers.integers(0, SIZE[1], 5), random_numbers.integers(0, SIZE[0], 5)] ^= 1


@pytest.mark.parametrize("codec", [zstd_tiles(), jpeg_tiles(90)], ids=["zstd", "jpeg"])
def test_tiles_of_an_unchanged_image_are_not_sent(codec: object, smooth: Bytes) -> None:
    stream = Tiles(SIZE, codec)  # type: ignore[arg-type]
    first = through(stream, smooth).copy()
    assert stream.encode(smooth.copy()) == b""
    assert np.array_equal(stream.decode(b""), first)


def test_one_changed_pixel_sends_one_tile_and_changes_no_other(smooth: Bytes) -> None:
    stream = Tiles(SIZE, jpeg_tiles(90))
    before = through(stream, smooth).copy()
    changed = smooth.copy()
    changed[20, 35] ^= 0xFF  # in the tile of rows 16 to 31, columns 32 to 47
    message = stream.encode(changed)
    differs = (stream.decode(message) != before).any(2)
    assert np.flatnonzero(np.unpackbits(np.frombuffer(message, np.uint8, 3))).tolist() == [5 + 2]  # 5 tiles a row
    assert differs[16:32, 32:48].any()
    differs[16:32, 32:48] = False
    assert not differs.any()


def test_jpeg_is_off_by_no_more_than_its_quality_says(smooth: Bytes) -> None:
    assert 0.0 < off(through(Jpeg(90), smooth), smooth) < JPEG_CODES
    assert off(through(Tiles(SIZE, jpeg_tiles(90)), smooth), smooth) < JPEG_CODES


def test_mosaic_of_more_tiles_than_a_row_holds_keeps_their_order(random_numbers: np.random.Generator) -> None:
    greys = random_numbers.integers(0, 256, 150).astype(np.uint8)
    tiles = np.broadcast_to(greys[:, None, None, None], (150, TILE, TILE, 3))
    codec = jpeg_tiles(90)
    assert np.abs(codec.unpack(codec.pack(tiles), 150).astype(int) - tiles).max() <= 2


def test_video_shows_every_image_at_once_and_within_its_bound(smooth: Bytes) -> None:
    stream = H264(SIZE, crf=18, pixels="yuv420p", preset="veryfast", refresh_hz=REFRESH_HZ)
    for k in range(4):
        image = np.roll(smooth, 2 * k, axis=1)
        assert off(through(stream, image), image) < H264_CODES


def test_video_without_its_library_is_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch, setup: Setup) -> None:
    monkeypatch.setattr(methods_streams, "find_spec", lambda name: None)
    with pytest.raises(RunError, match=r"stream_h264 needs PyAV.*pip install"):
        methods_streams.METHODS["stream_h264"](setup)


class Recorded:
    """A stream, and the messages it made."""

    def __init__(self, stream: Stream) -> None:
        self.stream, self.messages = stream, list[bytes]()

    def encode(self, image: Bytes) -> bytes:
        self.messages.append(self.stream.encode(image))
        return self.messages[-1]

    def decode(self, message: bytes) -> Bytes:
        return self.stream.decode(message)


def test_bytes_are_those_of_all_messages_but_the_free_first(setup: Setup, compiled_only: None) -> None:
    recorded = Recorded(Tiles(setup.size, zstd_tiles()))
    method = StreamMethod(setup, recorded)
    for k in range(1, 7):
        method.advance(k / REFRESH_HZ)
        method.show(k / REFRESH_HZ)
    assert len(recorded.messages) == 6
    assert method.bytes == sum(map(len, recorded.messages[1:])) > 0


def test_lossless_stream_shows_what_the_samples_do_but_for_eight_bits(setup: Setup, compiled_only: None) -> None:
    ours, method = AdaptiveMethod(setup), methods_streams.METHODS["stream_zstd_tiles"](setup)
    for k in range(1, 5):
        for each in (ours, method):
            each.advance(k / REFRESH_HZ)
        a, b = (display_values(each.show(k / REFRESH_HZ)) for each in (ours, method))
        assert np.abs(a - b).max() < 1.5 / 255  # half a code of rounding, one of the curve's table
    assert (method.rays, method.secondary) == (ours.rays, ours.secondary)


def test_image_that_did_not_change_costs_nothing(setup: Setup, compiled_only: None) -> None:
    method = methods_streams.METHODS["stream_raw"](setup)
    method.show(0.0)
    method.show(0.0)
    assert method.bytes == 0
    method.advance(1 / REFRESH_HZ)
    method.show(1 / REFRESH_HZ)
    assert method.bytes == 3 * setup.rect.area


def test_every_code_survives_the_way_to_light_and_back(tmp_path: Path) -> None:
    from wall.display.image_file import write_image

    light = methods_streams.light_of_codes()
    write_image(tmp_path / "ramp.png", np.repeat(light[None, :, None], 3, axis=2))
    assert np.array_equal(np.asarray(Image.open(tmp_path / "ramp.png"))[0, :, 1], np.arange(256))
