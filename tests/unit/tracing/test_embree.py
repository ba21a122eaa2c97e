"""What Embree leaves behind: no busy threads, no memory of what nobody holds."""

from __future__ import annotations

import gc
import time

import numpy as np

from wall.tracing import embree
from wall.tracing.embree import Device

REST_S = 0.5
LARGEST_SHARE = 0.2  # of one core, at rest: other threads of the process may do a little


def triangle() -> tuple[np.ndarray, np.ndarray]:
    vertices = np.zeros((5, 3), np.float32)  # two more, which Embree may read
    vertices[1, 0] = vertices[2, 1] = 1.0
    return vertices[:3], np.array([[0, 1, 2]], np.uint32)


def test_many_scenes_leave_no_thread_spinning() -> None:
    for _ in range(3):
        Device().mesh(*triangle())
    began = time.process_time()
    time.sleep(REST_S)
    assert time.process_time() - began < LARGEST_SHARE * REST_S


def test_scenes_go_with_the_last_that_holds_them(monkeypatch) -> None:
    released = []
    monkeypatch.setattr(embree._library, "rtcReleaseScene", released.append)
    device = Device()
    scenes = [device.mesh(*triangle()) for _ in range(2)]
    del device
    gc.collect()
    assert released == scenes[::-1]
