"""Images written strip by strip: read back by other libraries, and a large one without holding it in memory."""

from __future__ import annotations

import subprocess
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
import tifffile
from numpy.typing import NDArray
from PIL import Image

from wall.core.errors import ConfigError, LocalProtocolError, RunError
from wall.display.image_file import display_values
from wall.display.strip_file import STRIP_ROWS, check_file, is_linear, write_strips

SIZES = [(1, 1), (37, 1), (5, STRIP_ROWS), (41, STRIP_ROWS + 1), (300, 3 * STRIP_ROWS + 7)]
SUFFIXES = [".png", ".exr", ".tiff", ".tif"]


def noise(width: int, height: int, *, linear: bool) -> NDArray[Any]:
    values = np.random.default_rng(width).integers(0, 256, (height, width, 3), dtype=np.uint8)
    return values.astype(np.float32) * np.float32(0.037) - np.float32(1) if linear else values


def strips_of(image: NDArray[Any]) -> Iterator[NDArray[Any]]:
    for y in range(0, len(image), STRIP_ROWS):
        yield image[y : y + STRIP_ROWS]


def read(path: Path) -> NDArray[Any]:
    if is_linear(path):
        return np.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels)
    return np.asarray(Image.open(path))


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_what_is_written_is_read_back_exactly(tmp_path: Path, suffix: str, width: int, height: int) -> None:
    path = tmp_path / f"picture{suffix}"
    image = noise(width, height, linear=is_linear(path))
    write_strips(path, strips_of(image), width=width, height=height)
    np.testing.assert_array_equal(read(path), image)
    if path.suffix.startswith(".tif"):
        np.testing.assert_array_equal(tifffile.imread(path).reshape(image.shape), image)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_pngs_say_that_they_are_srgb(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_strips(path, strips_of(noise(3, 2, linear=False)), width=3, height=2)
    assert Image.open(path).info["srgb"] == 0


def test_display_values_are_rounded_srgb() -> None:
    linear = np.array([[[-1.0, 0.0, 0.0031308], [0.2158605, 1.0, 7.0]]], np.float32)
    assert display_values(linear).tolist() == [[[0, 0, 10], [128, 255, 255]]]  # IEC 61966-2-1: 10.3, 128.0


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_strips_that_are_not_the_image_leave_no_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    image = noise(8, STRIP_ROWS + 3, linear=is_linear(path))
    with pytest.raises(LocalProtocolError, match=r"row 64: a strip \(3, 8, 3\).*wanted \(4, 8, 3\)"):
        write_strips(path, strips_of(image), width=8, height=STRIP_ROWS + 4)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_source_leaves_the_old_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_strips(path, strips_of(noise(4, 4, linear=False)), width=4, height=4)
    before = path.read_bytes()

    def broken() -> Iterator[NDArray[Any]]:
        yield noise(4, STRIP_ROWS, linear=False)
        raise RunError("the light went out")

    with pytest.raises(RunError, match="the light went out"):
        write_strips(path, broken(), width=4, height=2 * STRIP_ROWS)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]


def test_what_cannot_be_written_is_refused_beforehand() -> None:
    with pytest.raises(ConfigError, match=r"there is no folder"):
        check_file(Path("/nowhere/at/all/a.png"), 4, 4)
    with pytest.raises(ConfigError, match=r"cannot write '.jpg'; accepted: .png, .exr, .tiff, .tif"):
        check_file(Path("a.jpg"), 4, 4)
    with pytest.raises(ConfigError, match=r"2147483648x4 pixels: wanted 1 to 2147483647"):
        check_file(Path("a.png"), 2**31, 4)


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.mkdir()
    with pytest.raises(RunError, match=r"cannot write .*a\.png: Is a directory"):
        write_strips(path, strips_of(noise(4, 4, linear=False)), width=4, height=4)


WIDTH, HEIGHT = 32768, 8192
# VmHWM, since what getrusage says begins with the peak of the process that started this one.
PEAK_MB = 160  # of the process: Python, NumPy and the libraries have 35, four strips 25; the image would be 805
WRITE = """\
import re, sys
from pathlib import Path
import numpy as np
from test_strip_files import HEIGHT, WIDTH, strip_of
from wall.display.strip_file import STRIP_ROWS, write_strips
strips = (strip_of(k) for k in range(HEIGHT // STRIP_ROWS))
write_strips(Path(sys.argv[1]), strips, width=WIDTH, height=HEIGHT)
print(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1])
"""


def strip_of(k: int) -> NDArray[np.uint8]:
    """Ramps, other ones in each strip."""
    x = np.arange(WIDTH)
    row = np.stack([x // 97, x // 3, x // 1000], axis=-1).astype(np.uint8)
    return np.broadcast_to(row ^ np.uint8(k % 251), (STRIP_ROWS, WIDTH, 3))


def test_a_large_image_is_written_in_a_fraction_of_its_memory(tmp_path: Path, compiled_only: None) -> None:
    path, here = tmp_path / "large.png", Path(__file__).parent
    command = [sys.executable, "-c", WRITE, str(path)]
    paths = f"{here}:{here.parents[2]}"
    done = subprocess.run(command, env={"PYTHONPATH": paths}, capture_output=True, text=True, check=True)
    assert int(done.stdout) * 1024 / 1e6 < PEAK_MB
    assert_is_the_image(path)


def assert_is_the_image(path: Path) -> None:
    """Every byte unpacks, to the right number of them; every 16th strip is compared."""
    strip_bytes, unpacker, rest, strips = STRIP_ROWS * (1 + 3 * WIDTH), zlib.decompressobj(), b"", 0
    above = np.zeros(3 * WIDTH, np.uint8)
    for data in image_data(path):
        rest += unpacker.decompress(data)
        while len(rest) >= strip_bytes:
            lines = np.frombuffer(rest[:strip_bytes], np.uint8).reshape(STRIP_ROWS, -1)
            assert (lines[:, 0] == 2).all()  # each row is the one above plus this
            if strips % 16 == 0:
                values = np.cumsum(np.vstack([above, lines[:, 1:]]), axis=0, dtype=np.uint8)[1:]
                np.testing.assert_array_equal(values.reshape(STRIP_ROWS, WIDTH, 3), strip_of(strips))
            above = strip_of(strips)[-1].ravel()
            strips, rest = strips + 1, rest[strip_bytes:]
    assert (strips, rest, unpacker.eof) == (HEIGHT // STRIP_ROWS, b"", True)


def image_data(path: Path) -> Iterator[bytes]:
    """The data of the PNG's IDAT chunks, their checksums checked."""
    with path.open("rb") as file:
        assert file.read(8) == b"\x89PNG\r\n\x1a\n"
        while head := file.read(8):
            data = file.read(int.from_bytes(head[:4], "big"))
            assert int.from_bytes(file.read(4), "big") == zlib.crc32(head[4:] + data)
            if head[4:] == b"IDAT":
                yield data
