"""Write planes of whole numbers as streams of bits, and read them back.

Golomb-Rice codes as in JPEG-LS (Weinberger, Seroussi, Sapiro 2000): a moving mean says how many low bits of the next
number are written as they are. Whatever decides what is written is an integer, so all machines agree.
"""

from __future__ import annotations

import numpy as np

from wall.core.jit import inline_kernel, kernel

LONGEST_RUN = 12  # of zeros in a Rice code; a number that would need more is written in 24 bits
ESCAPE_BITS = 24
LONGEST_CODE = LONGEST_RUN + 1 + ESCAPE_BITS  # bits
MEAN_SHIFT = 4  # a mean forgets in 16 numbers


@inline_kernel
def low_bits(mean):
    """How many low bits of a number are written as they are: as many as 5/8 of the moving mean has."""
    scaled = np.float32((mean * 5) >> (MEAN_SHIFT + 3))
    return max(np.int64(scaled.view(np.int32) >> 23) - 126, 0)


@kernel
def put_all(numbers, bits, words, at):
    """Append numbers (n,) of 0 to 32 bits each. at : (3,) int64: bits that wait for a full word, how many, words."""
    waiting, count, word = at[0], at[1], at[2]
    for i in range(numbers.shape[0]):
        waiting |= np.int64(numbers[i]) << count
        count += bits
        if count >= 32:
            words[word] = np.uint32(waiting & 0xFFFFFFFF)
            waiting, count, word = waiting >> 32, count - 32, word + 1
    at[0], at[1], at[2] = waiting, count, word


@kernel
def put_plane(numbers, mean, words, at):
    """Append numbers (n,) from 0 to 2^24 - 1 in Rice codes whose mean begins at `mean`. at : as for put_all."""
    waiting, count, word = at[0], at[1], at[2]
    mean <<= MEAN_SHIFT
    for i in range(numbers.shape[0]):
        number = np.int64(numbers[i])
        k = low_bits(mean)
        run = number >> k
        mean += number - (mean >> MEAN_SHIFT)
        bits = run + 1 + k
        if run >= LONGEST_RUN or bits > 32:
            waiting |= np.int64(1) << (count + LONGEST_RUN)
            count += LONGEST_RUN + 1
            if count >= 32:
                words[word] = np.uint32(waiting & 0xFFFFFFFF)
                waiting, count, word = waiting >> 32, count - 32, word + 1
            code, bits = number, np.int64(ESCAPE_BITS)
        else:
            code = ((number & ((1 << k) - 1)) << (run + 1)) | (1 << run)
        waiting |= code << count
        count += bits
        if count >= 32:
            words[word] = np.uint32(waiting & 0xFFFFFFFF)
            waiting, count, word = waiting >> 32, count - 32, word + 1
    at[0], at[1], at[2] = waiting, count, word


@inline_kernel
def ahead(words, position):
    """The 33 or more bits from a position on; 0 beyond the end, of which the last word is."""
    word = min(position >> 5, words.shape[0] - 2)
    both = np.uint64(words[word]) | (np.uint64(words[word + 1]) << np.uint64(32))
    return np.int64((both >> np.uint64(position & 31)) & np.uint64(0x1FFFFFFFF))


@kernel
def get_all(numbers, bits, words, position):
    """Fill numbers (n,) with `bits` bits each; returns the position behind them. The inverse of put_all."""
    mask = (np.int64(1) << bits) - 1
    for i in range(numbers.shape[0]):
        numbers[i] = ahead(words, position) & mask
        position += bits
    return position


@kernel
def get_plane(numbers, mean, words, position):
    """Fill numbers (n,) with what put_plane wrote; returns the position behind them."""
    mean <<= MEAN_SHIFT
    for i in range(numbers.shape[0]):
        k = low_bits(mean)
        bits = ahead(words, position)
        ended = bits | (1 << LONGEST_RUN)
        run = np.int64(np.float32(ended & -ended).view(np.int32) >> 23) - 127
        if run >= LONGEST_RUN or run + 1 + k > 32:
            number = ahead(words, position + run + 1) & ((1 << ESCAPE_BITS) - 1)
            position += run + 1 + ESCAPE_BITS
        else:
            number = (run << k) | ((bits >> (run + 1)) & ((1 << k) - 1))
            position += run + 1 + k
        mean += number - (mean >> MEAN_SHIFT)
        numbers[i] = number
    return position


@inline_kernel
def folded(number):
    """0, -1, 1, -2, 2 ... as 0, 1, 2, 3, 4."""
    return (number << 1) ^ (number >> 63)


@inline_kernel
def unfolded(number):
    return (number >> 1) ^ -(number & 1)


@inline_kernel
def bits_of(number):
    """Bits that hold the numbers 0 to `number`."""
    bits = np.int64(0)
    while number >> bits > 0:
        bits += 1
    return bits
