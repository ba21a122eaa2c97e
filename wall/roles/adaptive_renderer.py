"""The adaptive sampler with the renderer's own deep buffer, from which it sees where samples are missing."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import partial
from itertools import pairwise

from wall.config.sampling import AdaptiveSampling
from wall.core.clock import Clock
from wall.core.data import Event, Rect, Region, Samples
from wall.core.errors import RunError
from wall.geometry.cameras import PanelView
from wall.geometry.moving import MovingEvent
from wall.geometry.prediction import foreseen
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.image_sampler import ImageSampler
from wall.roles.plan import Plan, make_predictor
from wall.roles.renderer_image import SETTLED_S, OwnImage
from wall.sampling.adaptive import FOOTPRINT_MOVING, AdaptiveSampler
from wall.sampling.base import Targets
from wall.sampling.tiles import Measured
from wall.scene.needs import needs

SHARE_OF_TIME = 0.2  # at most spent on refreshing the renderer's deep buffer, which may lag behind the displayed one
SHARE_OF_STILL_TIME = 0.1  # at most spent on scoring all pixels, where nothing has moved for SETTLED_S
SURELY_SHOWN = 2  # refreshes after an event, by when displays elsewhere show it too: they accumulate only from there on


class AdaptiveRenderer:
    """A Sampler: refreshes the renderer's deep buffer when that is due, then chooses.

    Where the renderer makes the image that is shown, it gives that one's reconstruction, and refreshes it.
    """

    coherent = AdaptiveSampler.coherent

    def __init__(
        self,
        plan: Plan,
        sampling: AdaptiveSampling,
        region: Region,
        band: Rect,
        clock: Clock,
        shown: OwnImage | None = None,
    ) -> None:
        """`band`: its part of the region; `shown`: the image that this rank makes itself."""
        panel = plan.layout.panel(region)
        self._panel_view = PanelView(plan.view_of(panel), panel)
        scene = plan.scene_of(region.view)
        self.reconstruction = shown.reconstruction if shown is not None else Reconstruction(
            panel, self._panel_view.eye, scene, detects_change=needs(scene).change_detection, rect=band,
            samples_per_pixel=sampling.samples_per_pixel,
        )  # fmt: skip
        self._sampling = sampling
        make = partial(AdaptiveSampler, batch=sampling.samples_per_batch, seed=sampling.seed, tiling=sampling.tiling)
        self.sampler = ImageSampler(self.reconstruction, make)
        self._shown, self._refreshes = shown, 0
        shown_hz = plan.layout.layer(region).refresh_hz or plan.view_of(panel).refresh_hz
        self._clock, self._interval = clock, 1.0 / shown_hz
        self._replan_due = self._moved_at = float("-inf")
        self._due, self._rested = float("-inf"), 0  # refreshes since anything moved
        self._predictor = make_predictor(plan, panel.view)
        self._newest: Event | None = None
        self._event: Event | None = None  # that rays are traced under, the first row's where rows are seen in turn
        self._scan = panel.scan
        self._expected: Event | None = None  # how that goes on
        self._bands: deque[tuple[float, Targets]] = deque()  # see Scan.bands: chosen, but not traced yet
        self._traced: Event | None = None  # that of the newest batch
        self._chose_at, self._sweeps = 0.0, False  # when it was chosen; it is of a sweep

    def choose(self, newest: Event) -> Targets | None:
        """Returns the next batch's targets from the sampler; first refreshes the deep buffer if that is due."""
        now = self._chose_at = self._clock.now()
        if self._shown is not None:
            if (swept := self._follow(newest, self._shown, now)) is not None:
                self._traced = swept.event
                return swept
        elif now >= self._due:
            self.reconstruction.refresh(self._panel_view(self._expect(newest, now)), now)
            self._rested = self._rested + 1 if self.reconstruction.nothing_moves else 0
            if self._rested == SURELY_SHOWN:
                self.reconstruction.limit_means()
            self.sampler.replan()
            took = self._clock.now() - now
            self._due = now + max(self._interval, took / SHARE_OF_TIME)
        elif newest is not self._newest:
            self._expect(newest, now)
        targets = self._choose_rows() if self._scan is not None else self.sampler.choose(self._event or newest)
        self._traced = targets.event if targets is not None else self._traced
        return targets

    def _follow(self, newest: Event, shown: OwnImage, now: float) -> Targets | None:
        """Rays are for what is shown. Returns those of a sweep that makes the image finer, if there is one."""
        refinement, image = shown.refinement, shown.reconstruction
        xy = refinement.take(self._sampling.samples_per_batch)
        self._sweeps = len(xy) > 0
        rescaled = not self._sweeps and self.sampler.rescaled
        if self._event is None or image.refreshes != self._refreshes or rescaled:
            self._refreshes = image.refreshes
            self._expected = shown.view.at_next_refresh(now) if shown.expected is not None else newest
            self._event = foreseen(newest, self._expected)
            if not self._sweeps:
                self._replan(now)
        elif newest.edits.number != self._event.edits.number:  # an edit is seen at once, wherever the camera is
            self._event = replace(self._event, edits=newest.edits, scene_event=newest.scene_event)
        if not self._sweeps:
            return None
        event = newest if refinement.first else self._event
        return Targets(xy=xy, event=event, footprint=FOOTPRINT_MOVING * refinement.scale)

    def _replan(self, now: float) -> None:
        """Score the pixels of the image that was refreshed anew.

        Where nothing moves for long, in a share of the time at most: samples keep scores up to date where they come.
        """
        self._moved_at = self._moved_at if self.reconstruction.nothing_moves else now
        if now - self._moved_at < SETTLED_S or self.sampler.rescaled or now >= self._replan_due:
            self.sampler.replan()
            self._replan_due = now + (self._clock.now() - now) / SHARE_OF_STILL_TIME

    def _choose_rows(self) -> Targets | None:
        """The next batch, or while something moves a band of rows of it: a moment has its own camera."""
        event, expected = self._event, self._expected
        assert event is not None
        assert self._scan is not None
        if not self._bands:
            targets = self.sampler.choose(event)
            if targets is None or not isinstance(expected, MovingEvent):
                return targets
            self._bands.extend((time, replace(targets, xy=xy)) for time, xy in self._scan.bands(targets.xy))
        seconds, targets = self._bands.popleft()
        if isinstance(expected, MovingEvent):
            event = foreseen(event, expected.after(seconds))
        return replace(targets, event=event)

    def _expect(self, newest: Event, now: float) -> Event:
        """What a display that is refreshed now shows; rays are for one that is refreshed an interval later.

        Half of that passes until the next refresh, on average, which shows the middle of its own.
        """
        self._predictor.take(newest)
        self._newest, self._expected = newest, self._predictor.at(now, next_in=self._interval)
        self._event = foreseen(newest, self._expected)
        return self._predictor.at(now)

    def observe(self, samples: Samples, base_time: float) -> None:
        """Insert samples into the deep buffer, and update the scores by what they contradict."""
        if self._traced is not None:
            self.sampler.insert(samples, base_time, self._panel_view(self._traced), chosen=not self._sweeps)
            if self._shown is not None:
                self._shown.refinement.traced(len(samples), self._chose_at, self._clock.now(), swept=self._sweeps)

    @property
    def demand(self) -> float:
        """How many samples its pixels want, up to a factor; see AdaptiveSampler.demand."""
        return self.sampler.current.demand

    def measure(self) -> Measured:
        """What is known of the band's tiles since the last refresh."""
        return self.sampler.current.measure()

    def forget(self, samples: Samples, base_time: float) -> None:
        """Take back samples whose packet was dropped, so that their pixels are sampled again."""
        self.sampler.forget(samples, base_time)

    def restart(self) -> None:
        """Removes all samples and makes the next refresh due at once."""
        self.reconstruction.clear()
        if self._shown is not None:
            self._shown.refinement.end()
        self._bands.clear()
        self._due = float("-inf")


def bands(rect: Rect, count: int) -> list[Rect]:
    """A region cut into bands, one a thread. Raises RunError if it has fewer pixel rows than threads."""
    if count > rect.height:
        raise RunError(f"{count} threads cannot share a region of {rect.height} pixel rows; wanted: at most as many")
    edges = [rect.height * k // count for k in range(count + 1)]
    return [Rect(x=rect.x, y=rect.y + top, width=rect.width, height=bottom - top) for top, bottom in pairwise(edges)]
