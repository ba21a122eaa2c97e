"""What gets nothing new is framed in windows, seen by real screenshots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from shown_panels import looks_like, noise, on_black, panels, shown, window
from x_servers import x_server

from wall.display.stale_marks import COLOURS
from wall.display.window import WindowSink

SETTLED_S = 20.0


def test_what_gets_nothing_new_is_framed_until_it_does() -> None:
    """Places of the virtual screen, in pixels of a panel that has one for two of them; the middle stays as it is."""
    with x_server("300x200") as display:
        _framed_until_it_does(f"{display}.0")


def _framed_until_it_does(screen: str) -> None:
    two = panels((97, 61), (50, 33), display=screen, window=[window(10, 20, 97, 61), window(150, 100, 50, 33)])
    two[1] = replace(two[1], span=(100, 66))
    first, second = noise(97, 61), noise(50, 33, 2)
    images = [shown(two[0], first), shown(two[1], second)]
    sink = WindowSink(two, refresh_hz=60)
    try:
        sink.put(images)
        sink.put(images, [(97.0, 0.0, 60.0, 66.0)])
        assert sink.settled(SETTLED_S)
        framed = second.copy()
        stripes = np.add.outer(np.arange(33), np.arange(50)) // 4 % 2
        frame = np.zeros((33, 50), np.bool_)
        frame[:, :30] = True
        frame[4:-4, 4:26] = False
        framed[frame] = COLOURS[stripes][frame]
        assert looks_like(screen, on_black(300, 200, (10, 20, first), (150, 100, framed)))
        second[16, 2], second[16, 40] = 255 - second[16, 2], 0
        newer = [images[0], shown(two[1], second, 2)]
        sink.put(newer, [(97.0, 0.0, 60.0, 66.0)])
        assert sink.settled(SETTLED_S)
        framed[16, 40] = 0
        assert looks_like(screen, on_black(300, 200, (10, 20, first), (150, 100, framed))), "under the frame, too"
        sink.put(newer)
        assert sink.settled(SETTLED_S)
        assert looks_like(screen, on_black(300, 200, (10, 20, first), (150, 100, second)))
    finally:
        sink.close()
