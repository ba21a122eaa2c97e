"""What many tests start from."""

from __future__ import annotations

import functools
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace

import hypothesis
import numba
import numpy as np
import pytest
from small_scenes import View, view

from wall.core.clock import ManualClock
from wall.core.data import Event
from wall.reconstruction.gpu.device import Device, GpuError, device
from wall.scene.build import Scene
from wall.scene.sources import BUILT_IN
from wall.study.accuracy import scenes

JIT_DISABLED = bool(numba.config.DISABLE_JIT)
hypothesis.settings.register_profile("wall", deadline=None)  # an example may wait for other processes' turn
hypothesis.settings.load_profile("wall")


def pytest_configure(config: pytest.Config) -> None:
    """Build each built-in scene once: hundreds of tests load one, a fifth of a second each, and none writes to it.

    Hashes wrap around and misses divide by zero on purpose; uncompiled, NumPy warns of each.
    """
    BUILT_IN.update({name: functools.cache(make) for name, make in BUILT_IN.items()})
    if JIT_DISABLED:
        config.addinivalue_line("filterwarnings", "ignore:.*encountered in scalar.*:RuntimeWarning")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuse tests that watch the clock where launch/test does not look for them; skip what plain Python is too slow
    for before anything of it is set up."""
    for item in items:
        if JIT_DISABLED and "compiled_only" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.skip(reason="too many rays or pixels for NUMBA_DISABLE_JIT=1"))
        folder = item.path.parent.name
        if item.get_closest_marker("clock") is not None and folder not in ("process", "browser"):
            raise pytest.UsageError(f"{item.nodeid}: tests marked clock stand in tests/process or tests/browser")


@pytest.fixture
def compiled_only() -> None:
    """For tests of many rays or pixels: in plain Python, where they take minutes, they are skipped, see above."""


@pytest.fixture
def as_in_a_terminal() -> Iterator[None]:
    """A hang-up ends this process, also where the tests were started by `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def opengl() -> Device:
    """OpenGL of this thread, from a GPU or from Mesa's llvmpipe; without EGL the test is skipped with the reason."""
    if JIT_DISABLED:
        pytest.skip("NUMBA_DISABLE_JIT=1 is for kernels, which a GPU does not run")
    try:
        return device()
    except GpuError as error:
        pytest.skip(f"needs OpenGL 4.3 by EGL (Debian: libegl1 libgl1 libgl1-mesa-dri): {error.problem}")


@pytest.fixture
def manual_clock() -> ManualClock:
    """A clock at 100 s that only the test moves."""
    return ManualClock(100.0)


@pytest.fixture(scope="session")
def tiny_scene() -> Scene:
    """A floor, a ball and a smaller one beside it, a directional and a point light: 3 objects, 1,442 triangles."""
    return scenes.tiny_scene()


@pytest.fixture
def tiny_view() -> View:
    """32 x 24 pixels that show all of `tiny_scene`."""
    return view((0.0, 2.2, 5.0), (0.0, 0.6, 0.0), pixels=(32, 24))


@pytest.fixture
def camera_path(tiny_view: View) -> Callable[[int], Event]:
    """Event k of a camera that slides to the right, 0.1 units an event; its input came at 100 + k / 30 seconds."""

    def event(k: int) -> Event:
        x, y, z = tiny_view.event.camera.position
        camera = replace(tiny_view.event.camera, position=(x + 0.1 * k, y, z))
        return replace(tiny_view.event, camera_event=k, input_time=100.0 + k / 30.0, camera=camera)

    return event


@pytest.fixture
def random_numbers() -> np.random.Generator:
    return np.random.default_rng(20)
