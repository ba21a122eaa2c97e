"""The adaptive sampler and its reconstruction as an arm.

`adaptive`: one picture serves the sampler and the display, as where both are in one process. `adaptive:remote`: the
display has a picture of its own, made from nothing but the packets, as at a compositor. `adaptive:uniform`: every pixel
is worth the same. `adaptive:no_X`: without ingredient X of the picture. `adaptive:delayed`: what is made at a refresh
is seen at the next; `adaptive:predicted`: the same, but made, and its rays traced, for what is expected then;
`adaptive:predicted_picture`: made for it, but rays traced under the newest inputs; `..._2`: two refreshes later.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import partial

from wall.data import Batch, Event, Float32, Samples
from wall.measure.quality.arm import Arm, Inputs, Setup, centres, steps
from wall.measure.quality.late_display import LateDisplay
from wall.packets.samples import Codec, decode, encode
from wall.reconstruction.picture import ALL, Ingredients, Picture
from wall.sampling import kernels_adaptive
from wall.sampling.adaptive import AdaptiveSampler


class AdaptiveArm:
    def __init__(
        self,
        setup: Setup,
        *,
        remote: bool = False,
        uniform: bool = False,
        ingredients: Ingredients = ALL,
        late: int = 0,
        predicted: bool = False,
        ahead: bool = True,
    ) -> None:
        """`late`, `predicted`, `ahead`: see LateDisplay."""
        eye, scene = setup.plan.view.eye, setup.plan.scene
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._tracer = setup.tracer(coherent=True)
        self._picture = Picture(setup.panel, eye, scene, judging=True, ingredients=ingredients)
        self._shown = self._picture
        if remote:
            self._shown = Picture(setup.panel, eye, scene, judging=False)
        self._display = LateDisplay(setup.refresh_hz, refreshes=late, predicted=predicted, ahead=ahead)
        self._sampler = AdaptiveSampler(setup.rect, self._picture, batch=4096, seed=setup.seed, uniform=uniform)
        self._now, self._spent, self._sequence = 0.0, 0, 0
        self.rays = self.secondary = self.bytes = 0
        self._trace(centres(setup), self._inputs.event_at(0.0), 0.0)
        self.rays = self.secondary = self.bytes = 0

    def advance(self, until: float, rays: int | None = None) -> None:
        allowed = int(self._setup.rate * until) if rays is None else rays
        for now, owed in steps(self._now, until, self._spent, allowed, self._setup.input_step_s):
            if owed - self._spent < kernels_adaptive.PACKET:
                continue
            event = self._display.traced(self._inputs.event_at(now), now)
            targets = self._sampler.choose(event, owed - self._spent)
            if targets is None:
                self._spent = owed  # no pixel gains: this time passes unused
                continue
            self._spent += len(targets.xy)
            self._trace(targets.xy, event, now)
        self._now = until

    def _trace(self, xy: Float32, event: Event, now: float) -> None:
        self._tracer.take(event)
        samples, cost = self._tracer.trace(xy)
        self._picture.insert(samples, now, event)
        self._sampler.observe(samples)
        self.rays += cost.primary
        self.secondary += cost.shadow + cost.secondary
        for part in range(0, len(samples), 4096):
            self._send(samples[part : part + 4096], event, now)

    def _send(self, samples: Samples, event: Event, now: float) -> None:
        self._sequence += 1
        batch = Batch(
            view=0, panel=0, rect=self._setup.rect, rank=1, sequence=self._sequence, camera_event=event.camera_event,
            scene_event=event.scene_event, base_time=now, samples=samples, camera=event.camera,
            scene_time=event.scene_time, adaptive=True, relightable=self._setup.resident.needs.relighting,
        )  # fmt: skip
        packet = encode(batch, Codec.ZSTD)
        self.bytes += len(packet)
        if self._shown is not self._picture:
            came = decode(packet)
            self._shown.insert(came.samples, came.base_time, came)

    def show(self, time: float) -> Float32:
        event = self._display.made(self._inputs.event_at(time), time)
        self._picture.refresh(event, time)
        self._sampler.replan()
        if self._shown is not self._picture:
            self._shown.refresh(event, time)
        return self._display.seen(self._shown.radiance)


ARMS: dict[str, Callable[[Setup], Arm]] = {
    "adaptive": AdaptiveArm,
    "adaptive:remote": partial(AdaptiveArm, remote=True),
    "adaptive:uniform": partial(AdaptiveArm, uniform=True),
    "adaptive:delayed": partial(AdaptiveArm, late=1),
    "adaptive:delayed_2": partial(AdaptiveArm, late=2),
    "adaptive:predicted": partial(AdaptiveArm, late=1, predicted=True),
    "adaptive:predicted_2": partial(AdaptiveArm, late=2, predicted=True),
    "adaptive:predicted_picture": partial(AdaptiveArm, late=1, predicted=True, ahead=False),
    "adaptive:predicted_picture_2": partial(AdaptiveArm, late=2, predicted=True, ahead=False),
    **{
        f"adaptive:no_{field.name}": partial(AdaptiveArm, ingredients=Ingredients(**{field.name: False}))
        for field in fields(Ingredients)
    },
}
