"""Planes of numbers as bits, against codes written as text by the rules of docs/guide/packet_format.md."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.packets.kernels import bit_planes as kernels

WORDS = 4000


def text_of(number: int, bits: int) -> str:
    """The lowest bit first."""
    return f"{number:0{bits}b}"[::-1] if bits else ""


def rice_text(numbers: NDArray[np.int32], mean: int) -> str:
    text, moving = "", 16 * mean
    for number in map(int, numbers):
        low = int(np.float32(moving * 5 >> 7)).bit_length()
        run = number >> low
        if run < 12 and run + 1 + low <= 32:
            text += "0" * run + "1" + text_of(number & ((1 << low) - 1), low)
        else:
            text += "0" * 12 + "1" + text_of(number, 24)
        moving += number - (moving >> 4)
    return text


def written(text: str) -> NDArray[np.uint32]:
    """The words of a text of bits, and two of zeros."""
    text += "0" * (-len(text) % 32 + 64)
    return np.array([int(text[k : k + 32][::-1], 2) for k in range(0, len(text), 32)], np.uint32)


def finished(words: NDArray[np.uint32], at: NDArray[np.int64]) -> NDArray[np.uint32]:
    words[at[2]] = at[0]
    return np.concatenate([words[: at[2] + (at[1] > 0)], np.zeros(2, np.uint32)])


def planes() -> list[NDArray[np.int32]]:
    rng = np.random.default_rng(4)
    return [
        np.zeros(0, np.int32),
        np.zeros(40, np.int32),
        rng.geometric(0.1, 200).astype(np.int32),
        rng.geometric(0.001, 200).astype(np.int32),
        (2.0 ** rng.uniform(0, 24, 200) - 1).astype(np.int32),
        np.array([2**24 - 1, 0, 2**24 - 1, 0, 0, 1, 2**23], np.int32),
        np.full(50, 2**24 - 1, np.int32),
        np.where(rng.random(200) < 0.05, 2**24 - 1, 0).astype(np.int32),
    ]


@pytest.mark.parametrize("plane", planes(), ids=range(len(planes())))
@pytest.mark.parametrize("mean", [1, 64])
def test_rice_codes_are_those_of_the_document_and_read_back(plane: NDArray[np.int32], mean: int) -> None:
    words, at = np.zeros(WORDS, np.uint32), np.zeros(3, np.int64)
    kernels.put_all(np.array([5]), 3, words, at)
    kernels.put_plane(plane, mean, words, at)
    came = finished(words, at)
    text = "101" + rice_text(plane, mean)
    assert (came == written(text)).all()
    read = np.empty_like(plane)
    assert kernels.get_plane(read, mean, came, np.int64(3)) == len(text)
    assert (read == plane).all()


@pytest.mark.parametrize("bits", [0, 1, 3, 17, 31, 32])
def test_numbers_of_fixed_width_read_back(bits: int) -> None:
    numbers = np.random.default_rng(bits).integers(0, 1 << bits, 77)
    words, at = np.zeros(WORDS, np.uint32), np.zeros(3, np.int64)
    kernels.put_all(numbers, bits, words, at)
    came = finished(words, at)
    assert (came == written("".join(text_of(int(n), bits) for n in numbers))).all()
    read = np.empty_like(numbers)
    assert kernels.get_all(read, bits, came, np.int64(0)) == 77 * bits
    assert (read == numbers).all()


def test_beyond_the_end_everything_is_zero_and_nothing_is_touched() -> None:
    words = np.array([0xFFFFFFFF, 0, 0], np.uint32)
    numbers = np.empty(500, np.int32)
    assert kernels.get_all(numbers, 32, words, np.int64(16)) == 16 + 500 * 32
    assert numbers[0] == 0xFFFF
    assert not numbers[1:].any()
    assert kernels.get_plane(numbers, 3, words, np.int64(32)) == 32 + 500 * 37  # twelve zeros and no one: escapes
    assert not numbers.any()


def test_folding_is_undone() -> None:
    signed = [0, -1, 1, -2, 2, 2**23 - 1, -(2**23)]
    folded = [kernels.folded(np.int64(n)) for n in signed]
    assert folded[:5] == [0, 1, 2, 3, 4]
    assert max(folded) == 2**24 - 1
    assert [kernels.unfolded(np.int64(n)) for n in folded] == signed


def test_bits_of_a_number_are_as_many_as_it_has() -> None:
    assert [kernels.bits_of(n) for n in (-1, 0, 1, 2, 3, 4, 255, 256, 65535)] == [0, 0, 1, 2, 2, 3, 8, 9, 16]
