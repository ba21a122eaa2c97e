"""OpenGL for tests, from a GPU or from Mesa's llvmpipe."""

from __future__ import annotations

import pytest

from wall.reconstruction.gpu.device import Device, GpuError, device


@pytest.fixture
def opengl() -> Device:
    """This thread's device; without EGL the test is skipped with the reason."""
    try:
        return device()
    except GpuError as error:
        pytest.skip(f"needs OpenGL 4.3 by EGL (Debian: libegl1 libgl1 libgl1-mesa-dri): {error.problem}")
