"""X servers without a screen (Debian: xvfb), and what is seen on them."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ImageGrab
from Xlib import X
from Xlib.display import Display
from Xlib.ext import xtest

SEEN_WITHIN_S = 20.0  # an image that was put is on the screen; a loaded machine may take a second


@contextmanager
def x_server(*screens: str) -> Iterator[str]:
    """The display string of a fresh X server with these screens, such as "640x480"; skips where there is no Xvfb."""
    if shutil.which("Xvfb") is None:
        pytest.skip("needs an X server without a screen (Debian: xvfb)")
    reading, writing = os.pipe()
    sizes = [word for k, size in enumerate(screens) for word in ("-screen", str(k), f"{size}x24")]
    command = ["Xvfb", "-displayfd", str(writing), *sizes, "-noreset", "-nocursor", "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL, start_new_session=True)
    os.close(writing)
    try:
        with os.fdopen(reading) as numbers:
            number = numbers.readline().strip()
        assert number, "Xvfb did not start"
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()


def screenshot(display: str) -> NDArray[np.uint8]:
    """(h, w, 3) uint8: the root window of a screen with all that is on it, as its X server has it."""
    return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))


def comes_true(what: Callable[[], bool]) -> bool:
    """Whether something is so, or becomes so in time."""
    limit = time.monotonic() + SEEN_WITHIN_S
    while not what():
        if time.monotonic() > limit:
            return False
    return True


def scroll(display: str, at: tuple[int, int]) -> None:
    """Turn the wheel up by one notch, with the pointer at a place of the screen."""
    server = Display(display)
    server.screen().root.warp_pointer(*at)
    server.sync()
    for event in (X.ButtonPress, X.ButtonRelease):
        xtest.fake_input(server, event, 4)
    server.sync()
    server.close()


def press(display: str, key: int, window_at: tuple[int, int]) -> None:
    """Press and let go a key, over the window at a place of the screen."""
    server = Display(display)
    server.screen().root.warp_pointer(*window_at)
    code = server.keysym_to_keycode(key)
    for event in (X.KeyPress, X.KeyRelease):
        xtest.fake_input(server, event, code)
    server.sync()
    server.close()
