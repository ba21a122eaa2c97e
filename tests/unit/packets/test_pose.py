"""What packets say about where their samples were seen from."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from packet_examples import batch_of, plain_samples

from wall.data import Camera
from wall.errors import LocalProtocolError
from wall.packets.samples import decode, encode

CAMERA = Camera(position=(1e6 + 0.1, -2.5, math.pi), world_from_wall=(0.6, 0.0, 0.8, 0.0, 1.0, 0.0, -0.8, 0.0, 0.6))


def test_camera_scene_time_and_filter_come_back_exactly() -> None:
    sent = replace(batch_of(plain_samples(5)), camera=CAMERA, scene_time=12.345678901234567, adaptive=True)
    came = decode(encode(sent))
    assert (came.camera, came.scene_time, came.adaptive) == (CAMERA, 12.345678901234567, True)


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_pose_that_is_not_finite_is_not_sent(wrong: float) -> None:
    with pytest.raises(LocalProtocolError, match="finite"):
        encode(replace(batch_of(plain_samples(5)), scene_time=wrong))


def test_changes_come_back_within_a_thirtieth() -> None:
    samples = plain_samples(301)
    samples["change"] = np.linspace(0.0, 1.0, 301)
    error = np.abs(decode(encode(batch_of(samples))).samples["change"] - samples["change"])
    assert error.max() <= 1 / 30 + 1e-6
    assert error.max() > 0.9 / 30  # the bound is tight


def test_lighting_stays_at_the_sender() -> None:
    samples = plain_samples(5)
    samples["light"] = 0.5
    assert not decode(encode(batch_of(samples))).samples["light"].any()
