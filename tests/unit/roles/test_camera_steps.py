"""A look is taken where a camera may have jumped, and else at some of its steps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from wall.core.data import Camera
from wall.geometry.twist import rotation_by
from wall.roles.camera_steps import LOOK_EVERY, CameraSteps


def camera(x: float = 0.0, angle: float = 0.0) -> Camera:
    return Camera.of(np.array([x, 0.0, 5.0]), rotation_by(np.array([0.0, angle, 0.0])))


def looks(*cameras: Camera) -> list[bool]:
    steps = CameraSteps()
    return [steps.ask_for_a_look(*pair) for pair in pairwise(cameras)]


def test_a_camera_that_goes_on_evenly_is_looked_at_now_and_then() -> None:
    found = looks(*(camera(0.1 * k, 0.01 * k) for k in range(41)))
    assert found[0]
    assert sum(found) == 40 // LOOK_EVERY
    assert max(len(run) for run in "".join("x" if look else "." for look in found).split("x")) < LOOK_EVERY


def test_every_longer_step_is_looked_at_at_once() -> None:
    assert all(looks(*(camera(1.3**k) for k in range(20))))
    assert all(looks(*(camera(0.0, 1e-3 * 1.3**k) for k in range(20))))
    still = [camera(0.1 * k) for k in range(7)]
    assert looks(*still, camera(9.0), camera(9.1), camera(9.2))[6], "a jump"
    assert looks(*still, camera(0.6, 1.0))[6], "a turn"
