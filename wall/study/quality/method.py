"""Methods, which are compared: each spends the same rays and shows an image at every refresh of the display.

The clock is virtual: ray k of a method happens at k / rate seconds, with the inputs of that instant (shared by the rays
of at most INPUT_STEP_S), so a run depends on nothing but its setup and seed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wall.core.data import Batch, Event, Float32, Rect, Samples
from wall.geometry.panels import Panel
from wall.packets.samples import MAX_SAMPLES, Codec, decode, encode
from wall.roles.plan import Plan
from wall.sampling.ownership import block_order
from wall.scene.model import Moment
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import TracerScene

INPUT_STEP_S = 5e-4  # rays of this span share one camera and one scene time: a thirtieth of a 60 Hz refresh
ADAPTIVE_PACKET = 4096  # samples of one packet of the adaptive sampler, as its workers send them


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """The surroundings of one trial, whatever the method."""

    plan: Plan  # a wall of one panel
    tracer_scene: TracerScene
    rate: float  # primary rays a second
    refresh_hz: float
    seed: int
    input_step_s: float = INPUT_STEP_S  # longer at equal CPU time, where every look at the inputs is charged

    @property
    def panel(self) -> Panel:
        """The only panel of the wall."""
        return self.plan.layout.wall.panels[0]

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the image."""
        return self.panel.pixels

    @property
    def rect(self) -> Rect:
        """The image's rectangle, in pixels."""
        width, height = self.size
        return Rect(x=0, y=0, width=width, height=height)

    def tracer(self, *, coherent: bool) -> Tracer:
        """Returns a tracer of the scene; `coherent` if the pixels of a batch lie close together."""
        return Tracer(self.tracer_scene, self.panel, self.plan.view.eye, coherent=coherent)


class Inputs:
    """The newest event at a virtual time. Numbers stay where nothing changed; times must not go back."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._event: Event | None = None
        self._moment: Moment | None = None

    def event_at(self, time: float) -> Event:
        """Returns the event of `time`, in seconds; its numbers grow where the camera or the scene moved."""
        plan, last, was = self._plan, self._event, self._moment
        camera, moment = plan.view.camera_at(time), plan.scene.at(time)
        cameras, scenes = (0, 0) if last is None else last.number
        moved = was is None or not _same(was, moment)
        if last is not None:
            cameras += camera != last.camera
            scenes += moved
        self._moment = moment
        if last is not None and (cameras, scenes) == last.number:
            return last
        self._event = Event(
            view=0, camera_event=cameras, scene_event=scenes, scene_time=time, input_time=time, camera=camera
        )
        return self._event


def _same(a: Moment, b: Moment) -> bool:
    return (
        np.array_equal(a.world_from_object, b.world_from_object)
        and np.array_equal(a.point_positions, b.point_positions)
        and np.array_equal(a.directions, b.directions)
    )


def centres(setup: Setup) -> Float32:
    """(n, 2) float32: the middle of every pixel, 16 of a 4 x 4 block in a row."""
    return (block_order(setup.rect, worker=0, workers=1) + 0.5).astype(np.float32)


def steps(
    last: float, until: float, spent: int, allowed: int, step_s: float = INPUT_STEP_S
) -> Iterator[tuple[float, int]]:
    """The instants at which rays are traced between two times, and how many there should be in all by then."""
    count = max(1, round((until - last) / step_s))
    for k in range(1, count + 1):
        yield last + (until - last) * k / count, spent + (allowed - spent) * k // count


class Method(Protocol):
    """A way to spend rays: a sampler and its reconstruction. Its first image, one sample a pixel of time 0, is free."""

    rays: int  # primary rays spent so far, the free first image not counted
    secondary: int  # shadow and mirror rays beside them
    bytes: int  # sent to the display so far, as packets that the display's side could work from

    def advance(self, until: float, rays: int | None = None) -> None:
        """Spend the rays of virtual time up to `until` (seconds, growing): `rays` in all, else floor(rate * until)."""
        ...

    def show(self, time: float) -> Float32:
        """(h, w, 3) float32 linear RGB: what the display shows from refresh `time` on. Read before the next call."""
        ...


class MeteredTracer:
    """Traces rays, counts their cost, and sends the samples as packets."""

    def __init__(
        self,
        setup: Setup,
        *,
        coherent: bool,
        adaptive: bool = False,
        sends: bool = True,
        surfaces: bool = True,
        receive: Callable[[Batch], None] | None = None,
    ) -> None:
        """`adaptive` chooses the packets' layout. Without `sends` there are none. `receive` gets them decoded.

        Without `surfaces` plain samples bring neither depths nor objects.
        """
        self._tracer, self._rect = setup.tracer(coherent=coherent), setup.rect
        self._adaptive, self._sends, self._receive = adaptive, sends, receive
        self._surfaces = surfaces
        self._relightable = adaptive and setup.tracer_scene.needs.relighting
        self._noisy = adaptive and setup.tracer_scene.needs.paths
        self._sequence = 0
        self._placed: Event | None = None
        self.reset()

    def reset(self) -> None:
        """Set all counts to 0."""
        self.rays = self.secondary = self.bytes = 0

    @property
    def counts(self) -> tuple[int, int, int]:
        """Primary rays, other rays, bytes."""
        return self.rays, self.secondary, self.bytes

    def trace(
        self,
        xy: Float32,
        event: Event,
        time: float,
        *,
        frame: int = 0,
        frame_samples: int = 0,
        blend: float = 1.0,
        footprint: float = 1.0,
    ) -> Samples:
        """Samples at (n, 2) float32 panel pixels under `event`, counted and sent at `time` seconds."""
        samples, dropped = self.trace_only(xy, event, footprint)
        self.send(samples, event, time, frame=frame, frame_samples=frame_samples, dropped=dropped, blend=blend)
        return samples

    def trace_only(self, xy: Float32, event: Event, footprint: float = 1.0) -> tuple[Samples, int]:
        """Samples that are counted but not sent yet, and how many rays gave none."""
        if self._placed is not event:
            self._tracer.set_event(event)
            self._placed = event
        samples, cost = self._tracer.trace(xy, footprint)
        self.rays += cost.primary
        self.secondary += cost.shadow + cost.secondary
        return samples, cost.bad

    def send(
        self, samples: Samples, event: Event, time: float, *, frame: int = 0, frame_samples: int = 0,
        dropped: int = 0, blend: float = 1.0,
    ) -> None:  # fmt: skip
        """Send samples traced under `event`: as packets, at least one."""
        size = ADAPTIVE_PACKET if self._adaptive else MAX_SAMPLES
        for first in range(0, max(len(samples), 1) if self._sends else 0, size):
            self._sequence += 1
            batch = Batch(
                view=0, panel=0, rect=self._rect, rank=0, sequence=self._sequence, camera_event=event.camera_event,
                scene_event=event.scene_event, base_time=time, samples=samples[first : first + size], frame=frame,
                frame_samples=frame_samples, skipped=0 if first else dropped, blend=blend, camera=event.camera,
                scene_time=event.scene_time, adaptive=self._adaptive, relightable=self._relightable, noisy=self._noisy,
                depths=self._adaptive or self._surfaces, objects=self._adaptive or self._surfaces,
            )  # fmt: skip
            packet = encode(batch, Codec.ZSTD)
            self.bytes += len(packet)
            if self._receive is not None:
                self._receive(decode(packet))
