"""The one loop of this stage that is too slow in Python: walking a Hilbert curve."""

from __future__ import annotations

import numpy as np

from wall.core.jit import kernel

STACK = 512  # blocks that wait at once: three a halving, 31 halvings of an int32 edge, with room


@kernel
def fill_hilbert(order, width, height):
    """Write the pixels of a rectangle in generalised Hilbert order.

    A block is (x, y, ax, ay, bx, by): the curve enters at the corner (x, y), runs along the vector a and
    leaves at a's end; b is the block's other edge. One of ax, ay and one of bx, by is 0. A long block is cut
    in two along a; another in three: a turned block up half of b, a block along a, a turned block back down.
    A half is made even where it can be, since an odd edge makes the curve leave at the wrong side.

    Parameters
    ----------
    order : (width * height, 2) int32, written in place
    width, height : pixels

    Returns
    -------
    written : int, rows of `order` that were written

    Source: Hilbert 1891; cutting arbitrary rectangles after Zhang, Kamata and Ueshige 2006.
    """
    stack = np.empty((STACK, 6), np.int64)
    top, written = 0, 0
    if width > 0 and height > 0:
        stack[0, 0] = 0
        stack[0, 1] = 0
        stack[0, 2] = width if width >= height else 0
        stack[0, 3] = 0 if width >= height else height
        stack[0, 4] = 0 if width >= height else width
        stack[0, 5] = height if width >= height else 0
        top = 1
    while top > 0:
        top -= 1
        x, y, ax, ay, bx, by = stack[top]
        along, across = abs(ax + ay), abs(bx + by)
        step_x, step_y = np.sign(ax), np.sign(ay)
        side_x, side_y = np.sign(bx), np.sign(by)
        if along == 1 or across == 1:
            if across != 1:
                step_x, step_y, along = side_x, side_y, across
            for i in range(along):
                order[written, 0] = x + i * step_x
                order[written, 1] = y + i * step_y
                written += 1
            continue
        half_a, half_b = along // 2, across // 2
        if 2 * along > 3 * across:
            half_a += half_a % 2 if along > 2 else 0
            # the last block goes down first: the stack gives back the newest
            stack[top] = (
                x + half_a * step_x,
                y + half_a * step_y,
                ax - half_a * step_x,
                ay - half_a * step_y,
                bx,
                by,
            )
            stack[top + 1] = (x, y, half_a * step_x, half_a * step_y, bx, by)
            top += 2
            continue
        half_b += half_b % 2 if across > 2 else 0
        rest_x, rest_y = ax - half_a * step_x, ay - half_a * step_y
        end_x = x + ax - step_x + (half_b - 1) * side_x
        end_y = y + ay - step_y + (half_b - 1) * side_y
        stack[top] = (end_x, end_y, -half_b * side_x, -half_b * side_y, -rest_x, -rest_y)
        stack[top + 1] = (
            x + half_b * side_x,
            y + half_b * side_y,
            ax,
            ay,
            bx - half_b * side_x,
            by - half_b * side_y,
        )
        stack[top + 2] = (x, y, half_b * side_x, half_b * side_y, half_a * step_x, half_a * step_y)
        top += 3
    return written
