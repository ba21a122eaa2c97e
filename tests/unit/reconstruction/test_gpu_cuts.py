"""What a scene's cuts take away goes on a GPU as on the CPU. Tested on llvmpipe as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from adaptive_images import EVENT_S, GREEN, PLATE, RED, START, centres, event_at, hits, plate_before_wall
from gpu_twins import DECIDED_BY_ROUNDING, Twins
from small_scenes import view

from wall.core.data import Edits
from wall.reconstruction.gpu.device import Device
from wall.scene.model import Cut

SEEN = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(33, 25))


def test_samples_beyond_a_plane_go_at_once_and_late_ones_too(
    opengl: Device, random_numbers: np.random.Generator
) -> None:
    """A plane that is moved through a plate leaves half of it, then nothing."""
    cuts = (
        Cut(position=(9.0, 0.0, 0.0), normal=(1.0, 0.0, 0.2)),
        Cut(position=(0.0, -9.0, 0.0), normal=(0.0, -1.0, 0.0)),
    )
    twins = Twins(replace(plate_before_wall((0.0, 0.0, 2.0)), cuts=cuts), SEEN)
    plate = hits(random_numbers.uniform((10.0, 8.0), (23.0, 17.0), (90, 2)), RED, depth=2.0, object_id=PLATE)
    wall = hits(centres((33, 25)), GREEN)
    red = []
    for k, x in enumerate((9.0, 0.4, 0.4, -9.0, -9.0)):
        event = replace(event_at(k, SEEN), edits=Edits(k + 1, (("cuts.0.position", (x, 0.0, 0.0)),)))
        twins.insert(wall, START + k * EVENT_S, event)
        twins.insert(
            plate,
            START + k * EVENT_S,
            replace(event_at(0, SEEN), edits=Edits(1, (("cuts.0.position", (9.0, 0.0, 0.0)),))),
        )
        twins.refresh(event, START + (k + 1) * EVENT_S)
        twins.agree(decided=DECIDED_BY_ROUNDING)
        red.append(float((twins.gpu.radiance[..., 0] > 0.2).mean()))
    assert red[0] > red[1] > 0.05
    assert red[3:] == [0.0, 0.0]
