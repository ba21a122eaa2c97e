"""After any sequence of jumps a still view needs no more samples than one that begins, however late packets come."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wall.commands.render import render
from wall.config.loading import loads
from wall.core.data import Camera, Float64
from wall.geometry.steering import Command, Steering
from wall.roles.plan import Plan, make_layout, make_plan
from wall.run.single_process import SingleProcess, Wire
from wall.study.quality.metrics import display_values
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

WIDTH, HEIGHT = 48, 27  # so few that at 4 Hz pixels are complete before the first refresh
CONFIG = """\
version: 1
scene: {{source: courtyard, animation: []}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{width}, {height}], size: [0.48, 0.27]}}}}
views: [{{camera: {{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}}, refresh_hz: {refresh_hz}}}]
sampling: {{method: adaptive, samples_per_pixel: 2, samples_per_batch: 64}}
"""
REFERENCE_SPP = 256  # its own error is 0.4 codes
ALIKE = 1.0  # RMSE in 8-bit codes
NO_MORE_THAN = 1.5  # times the samples of a fresh start
PATIENCE = 100  # samples a pixel; a fresh start needs 30
STAY, PASS = 10.0, 4.0  # samples a pixel in a view before the last: plain surfaces are done; or nothing is


class LateWire:
    """Gives the packets of `wire` so many steps later, in their order."""

    def __init__(self, wire: Wire, steps: int) -> None:
        self._wire, self._on_their_way = wire, deque[list[bytes]]([[]] * steps)

    @property
    def packets(self) -> list[bytes]:
        self._on_their_way.append(self._wire.packets)
        self._wire.packets = []
        return self._on_their_way.popleft()

    @packets.setter
    def packets(self, taken: list[bytes]) -> None:
        assert not taken


class LatePackets(SingleProcess):
    """Packets come `late` steps after they were sent."""

    def __init__(self, plan: Plan, scene: TracerScene, *, at_renderers: bool, late: int) -> None:
        super().__init__(plan, scene, at_renderers=at_renderers)
        self._wire = LateWire(self._wire, late)  # type: ignore[assignment]

    @property
    def traced(self) -> int:
        return sum(worker.work.samples for worker in self.workers)

    def jump(self, camera: Camera) -> None:
        self.event = replace(
            self.event, camera_event=self.event.camera_event + 1, camera=camera, input_time=self.clock.now()
        )

    def stay(self, samples_a_pixel: float) -> None:
        until = self.traced + samples_a_pixel * WIDTH * HEIGHT
        while self.traced < until:
            self.step()

    def needed(self, reference: Float64) -> float:
        """Samples a pixel from now on until the image is like the reference."""
        first = self.traced
        while (spent := (self.traced - first) / (WIDTH * HEIGHT)) < PATIENCE:
            self.step()
            (image,) = self.composition.shown()[0].images()
            if np.sqrt(((image.rgb - reference) ** 2).mean()) < ALIKE:
                return spent
        return np.inf


def cameras(plan: Plan, commands: Sequence[Command]) -> list[Camera]:
    start = Steering.from_view(plan.view, 0.0)
    return [start.apply(command).camera() for command in commands]


def plan_of(refresh_hz: float) -> Plan:
    text = CONFIG.format(width=WIDTH, height=HEIGHT, refresh_hz=refresh_hz)
    return make_plan(make_layout(loads(text, path=Path("wall.yaml"))))


@pytest.fixture(scope="module")
def scene() -> TracerScene:
    return make_tracer_scene(plan_of(30).scene)


@pytest.fixture(scope="module")
def reference() -> Float64:
    converged = render(plan_of(30), spp=REFERENCE_SPP, seed=7, at=0.0)
    assert converged is not None
    return 255.0 * display_values(converged)


@pytest.mark.parametrize(
    ("at_renderers", "late", "refresh_hz"),
    [(True, 0, 30), (False, 0, 30), (False, 60, 30), (False, 10, 4), (True, 0, 4)],
    ids=["at the renderer", "at once", "late", "starved", "starved at the renderer"],
)
def test_jumps_leave_no_ghost_in_a_still_view(
    compiled_only: None, scene: TracerScene, reference: Float64, at_renderers: bool, late: int, refresh_hz: float
) -> None:
    plan = plan_of(refresh_hz)
    nearer, aside = cameras(plan, [Command(kind="zoom", x=6.8), Command(kind="orbit", x=0.3, y=0.1)])

    fresh = LatePackets(plan, scene, at_renderers=at_renderers, late=late).needed(reference)
    wall = LatePackets(plan, scene, at_renderers=at_renderers, late=late)
    wall.stay(STAY)
    home = wall.event.camera
    needed = {}
    for name, views in {"zoom": [nearer], "many": [aside, nearer, home, nearer, aside, nearer]}.items():
        for view in views:
            wall.jump(view)
            wall.stay(STAY if name == "zoom" else PASS)
        wall.jump(home)
        needed[name] = wall.needed(reference)

    print(f"samples a pixel: {needed}, a fresh start {fresh}")
    assert fresh < PATIENCE
    assert min(needed.values()) > 1.0, "no other view was shown"
    assert max(needed.values()) < NO_MORE_THAN * fresh, f"{needed}, a fresh start {fresh}"
