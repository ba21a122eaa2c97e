"""The adaptive sampler and its reconstruction as a method.

`adaptive`: one image serves the sampler and the display, as where both are in one process. `adaptive:full`: always of
all pixels and samples. `adaptive:remote`: the display has an image of its own, made from nothing but the packets, as at
a compositor; `..._every_2`, `..._every_6`: the sampler's is refreshed only at every so many of the display's refreshes.
`adaptive:uniform`: every pixel gains the same. `adaptive:cut`: tiles from a K-D cut instead of the grid.
`adaptive:no_X`: without ingredient X of the image. `adaptive:delayed`: what is made at a refresh is seen at the next;
`adaptive:predicted`: the same, but made, and its rays traced, for what is expected then; `adaptive:predicted_picture`:
made for it, but rays traced under the newest inputs; `..._2`: two refreshes later.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial

from wall.core.data import Batch, Event, Float32
from wall.geometry.prediction import Predictor, foreseen
from wall.reconstruction.reconstruction import Ingredients, Reconstruction
from wall.roles.manager import EVENTS_A_REFRESH
from wall.sampling.adaptive import AdaptiveSampler
from wall.sampling.kernels import adaptive as kernels_adaptive
from wall.study.quality.method import Inputs, MeteredTracer, Method, Setup, centres, steps
from wall.study.quality.sampled_image import SampledImage, Variant


@dataclass(frozen=True, slots=True, kw_only=True)
class Late:
    """How late images are seen."""

    refreshes: int = 0  # between making an image and seeing it
    predicted: bool = False  # images are made for when they are seen,
    ahead: bool = True  # and rays are traced for that moment as well


class LateDisplay:
    """A display that shows an image some refreshes after it was made. Inputs come as often as a manager sends them."""

    def __init__(self, refresh_hz: float, late: Late) -> None:
        self._predictor = Predictor(late.refreshes / refresh_hz, on=late.predicted)
        self._ahead = late.ahead and late.predicted
        self._images: deque[Float32] = deque(maxlen=late.refreshes + 1)
        self._interval, self._due = 1.0 / (refresh_hz * EVENTS_A_REFRESH), 0.0
        self._foreseen: Event | None = None

    def traced(self, event: Event, time: float) -> Event:
        """What rays are traced under at `time` (seconds, growing), when `event` is the newest."""
        if self._foreseen is None or time >= self._due:
            self._due = time + self._interval
            self._foreseen = foreseen(event, self.made(event, time))
        return self._foreseen if self._ahead else event

    def made(self, event: Event, time: float) -> Event:
        """What an image made at `time`, when `event` is the newest, is to show."""
        self._predictor.take(event)
        return self._predictor.at(time)

    def seen(self, made: Float32) -> Float32:
        """What is seen from now on, when `made` is handed in: the oldest image under way."""
        self._images.append(made if self._images.maxlen == 1 else made.copy())
        return self._images[0]


class AdaptiveMethod:
    """A Method: the adaptive sampler, its reconstruction, and a display."""

    def __init__(
        self,
        setup: Setup,
        *,
        remote: bool = False,
        every: int = 1,
        variant: Variant = Variant(),  # noqa: B008 (it is frozen)
        sends: bool = True,
        late: Late = Late(),
    ) -> None:
        """`every`: refreshes of the display from one of a remote sampler's image to the next.

        `sends`: whether samples are, not images made of them.
        """
        eye, scene = setup.plan.view.eye, setup.plan.scene
        self._setup, self._inputs = setup, Inputs(setup.plan)
        self._image = SampledImage(setup, replace(variant, full=True) if remote else variant)
        self._elsewhere = Reconstruction(setup.panel, eye, scene, detects_change=False) if remote else None
        self._tracer = MeteredTracer(
            setup, coherent=AdaptiveSampler.coherent, adaptive=True, sends=sends,
            receive=self._receive if remote else None,
        )  # fmt: skip
        self._display = LateDisplay(setup.refresh_hz, late)
        self._now, self._spent, self._every, self._refreshes = 0.0, 0, every, 0
        self._trace(centres(setup), self._inputs.event_at(0.0), 0.0)
        self._tracer.reset()
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def advance(self, until: float, rays: int | None = None) -> None:
        """See Method."""
        allowed = int(self._setup.rate * until) if rays is None else rays
        for now, owed in steps(self._now, until, self._spent, allowed, self._setup.input_step_s):
            if owed - self._spent < kernels_adaptive.PACKET:
                continue
            event = self._display.traced(self._inputs.event_at(now), now)
            targets = self._image.choose(event, owed - self._spent)
            if targets is None:
                self._spent = owed  # no pixel gains: this time passes unused
                continue
            self._spent += len(targets.xy)
            self._trace(targets.xy, event, now, targets.footprint)
        self._now = until
        self.rays, self.secondary, self.bytes = self._tracer.counts

    def _trace(self, xy: Float32, event: Event, now: float, footprint: float = 1.0) -> None:
        samples, _ = self._tracer.trace_only(xy, event, footprint)
        self._image.insert(samples, now, event)  # which writes into them what they contradict
        self._tracer.send(samples, event, now)

    def _receive(self, batch: Batch) -> None:
        assert self._elsewhere is not None
        self._elsewhere.insert(batch.samples, batch.base_time, batch)

    def show(self, time: float) -> Float32:
        """See Method."""
        event = self._display.made(self._inputs.event_at(time), time)
        if self._refreshes % self._every == 0:
            self._image.refresh(event, time)
        self._refreshes += 1
        if self._elsewhere is None:
            return self._display.seen(self._image.radiance)
        self._elsewhere.refresh(event, time)
        return self._display.seen(self._elsewhere.radiance)


METHODS: dict[str, Callable[[Setup], Method]] = {
    "adaptive": AdaptiveMethod,
    "adaptive:full": partial(AdaptiveMethod, variant=Variant(full=True)),
    "adaptive:remote": partial(AdaptiveMethod, remote=True),
    "adaptive:remote_every_2": partial(AdaptiveMethod, remote=True, every=2),
    "adaptive:remote_every_6": partial(AdaptiveMethod, remote=True, every=6),
    "adaptive:cut": partial(AdaptiveMethod, variant=Variant(tiling="cut")),
    "adaptive:uniform": partial(AdaptiveMethod, variant=Variant(uniform=True)),
    "adaptive:delayed": partial(AdaptiveMethod, late=Late(refreshes=1)),
    "adaptive:delayed_2": partial(AdaptiveMethod, late=Late(refreshes=2)),
    "adaptive:predicted": partial(AdaptiveMethod, late=Late(refreshes=1, predicted=True)),
    "adaptive:predicted_2": partial(AdaptiveMethod, late=Late(refreshes=2, predicted=True)),
    "adaptive:predicted_picture": partial(AdaptiveMethod, late=Late(refreshes=1, predicted=True, ahead=False)),
    "adaptive:predicted_picture_2": partial(AdaptiveMethod, late=Late(refreshes=2, predicted=True, ahead=False)),
    **{
        f"adaptive:no_{field.name}": partial(
            AdaptiveMethod, variant=Variant(ingredients=Ingredients(**{field.name: False}))
        )
        for field in fields(Ingredients)
    },
}
