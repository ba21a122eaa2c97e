"""The images that a renderer makes of its own samples, where they are shown on the same machine: no sample travels."""

from __future__ import annotations

import math
from collections.abc import Iterator

from wall.core.clock import Clock
from wall.core.data import Batch, Event, Region, StatisticsImage
from wall.reconstruction.dynamic_resolution import DynamicResolution
from wall.roles.composition import Composition
from wall.roles.edges import NEVER, summed_number
from wall.roles.instructions import Offer, Ready, Shares, shares_nothing
from wall.roles.layer import PanelCompositor
from wall.roles.plan import Plan
from wall.roles.refinement import Refinement
from wall.roles.resolution import ResolutionChoice, first_scale
from wall.roles.sample_budget import SampleBudget
from wall.roles.updates import UpdatesShown
from wall.roles.view import FollowedView

SHARE_OF_STILL_TIME = 0.25  # likewise where nothing has moved for SETTLED_S: rays make it better, and it cannot be late
SETTLED_S = 1.0
NEW_SHARE = 0.25  # of the pixels of a coarse image where nothing moves: with so many new samples it is refreshed,
LONGEST_PERIODS = 4  # or after so many periods; and at once where a sweep ends
KNOWN = 0.5  # of the image: where samples show less of it, its camera has jumped
LONGEST_SWEEP_S = 0.15  # until something is shown after a jump, whatever is missing
SHARE_OF_TIME = 0.9  # of a view's time at most spent on refreshes; rarer ones lag by more, see docs/lab/live.md


class OwnImage:
    """One region's image: `follow` events, `insert` batches, `refresh` when `due`."""

    def __init__(self, plan: Plan, region: Region, composition: Composition, clock: Clock) -> None:
        self._clock, self._composition = clock, composition
        self._layer: PanelCompositor = composition.layers[region.layer]
        self.view = FollowedView(plan, region.view)
        self.weight = plan.layout.config.views[region.view].weight
        self._moved_at = -math.inf  # the last refresh that showed another event than the one before, seconds
        self._budget, self._resolution = SampleBudget(), ResolutionChoice(self._layer.panel)
        self.refinement = Refinement(self._layer.panel, self.view.period, plan.cores)
        self._refines = self._layer.panel.scan is None and not plan.layout.config.barrier
        self._waits, self._due = math.inf, -math.inf  # for so many samples; when a refresh is due once they came
        self._swept_by = math.inf  # then an image is shown, whether its first sweep has ended or not
        self.expected: Event | None = None  # what the last refresh shows
        self.refreshing_s = 0.0  # seconds spent on refreshes so far
        self.rests = False  # the last refresh was of the newest event, and changed nothing

    @property
    def reconstruction(self) -> DynamicResolution:
        """The reconstruction that the adaptive sampler shares; made when it is first asked for."""
        return self._layer.reprojected.shared()

    def follow(self, event: Event) -> None:
        """Show a new event from the next refresh on; the manager repeats the newest, which changes nothing."""
        before, view = self.view.event, self.view
        if view.take(event):
            if view.may_wait and before is not None and event.number != before.number:
                view.due = min(view.due, view.soonest)  # it moves again
            self._composition.follow(event)
            self.rests = self.rests and event == before
            self._hasten()
            if before is not None and before.camera != event.camera:
                self._refine_after_jump(event)

    def _refine_after_jump(self, event: Event) -> None:
        """Begin anew, coarsely, where the samples that are stored show little of what is seen now, and next."""
        layer, refinement = self._layer, self.refinement
        if not self._refines or not layer.reprojects or self.expected is None:
            return
        covers = layer.reprojected.covers
        if covers(event) < KNOWN and covers(self.view.at_next_refresh(self._clock.now())) < KNOWN:
            if not refinement.first:
                self._swept_by = self._clock.now() + LONGEST_SWEEP_S
            self.reconstruction.gathers = True
            self.reconstruction.begin(refinement.begin(first_scale(layer.panel)))

    def insert(self, batch: Batch) -> None:
        """Show a batch from the next refresh on."""
        self._composition.insert_batch(batch)
        self._resolution.note(len(batch.samples))
        self.rests = False
        self._hasten()
        self._waits -= len(batch.samples)
        if self.refinement.swept:
            self.reconstruction.rescale(self.refinement.scale, whole=True)
            self.view.due = min(self.view.due, self._clock.now())
        elif self._waits <= 0.0:
            self.view.due = min(self.view.due, self._due)

    def _hasten(self) -> None:
        if self._composition.take_edited(self.view.index):
            self.view.hasten()

    def keep(self, tiles: StatisticsImage) -> None:
        """Keep the sampler's tiles for who looks at them."""
        self._composition.keep(tiles)

    def refresh(self, now: float, share: float) -> bool:
        """Refresh if that is due. Returns whether it was. `share`: of this rank's time that the view may have."""
        view = self.view
        if view.event is None or now < view.due:
            return False
        if self.refinement.first and not self.refinement.swept and now < self._swept_by:
            view.due = self._swept_by  # or once it is swept: until then the image before the jump stays
            return False
        began = self._clock.now()
        before, self.expected = self.expected, view.begin_refresh(now)
        expected = self.expected
        if before is None or before.number != expected.number:
            self._moved_at = now
        view.may_wait = now - self._moved_at > SETTLED_S
        self._layer.reprojected.keep(self._budget.after(view.lateness))
        changed = self._composition.refresh(expected, now)
        self.rests = not changed and expected.number == view.event.number
        took = self._clock.now() - began
        self.refinement.refreshed(self.reconstruction.scale, took)
        self._choose_resolution(still=before is not None and before.camera == expected.camera)
        refines = self._only_rays_help(before, expected)
        view.may_wait = view.may_wait or refines
        self.refreshing_s += took
        view.made(took)
        view.soonest = max(view.soonest, now + took / (SHARE_OF_TIME * share))
        most = SHARE_OF_STILL_TIME if view.may_wait else SHARE_OF_TIME
        view.due = max(view.due, now + took / (most * share))
        self._waits = math.inf
        if refines:
            if not self.refinement.active:
                self._waits, self._due = NEW_SHARE * self.reconstruction.current.rect.area, view.due
            view.due = max(view.due, now + LONGEST_PERIODS * view.period)
        return True

    def _choose_resolution(self, *, still: bool) -> None:
        """After a refresh; `still`: the camera stood."""
        image, refinement, now = self.reconstruction, self.refinement, self._clock.now()
        if refinement.active and not self._layer.reprojects:
            refinement.end()
        if refinement.active:
            refinement.shown(still=still or refinement.first)
            if not refinement.active:
                scale = refinement.scale if still else image.scale
                self._resolution.resume(now, scale, still=still)
                image.rescale(scale)
        else:
            image.rescale(self._resolution.after(now, still=still, stored=image.count, at_rest=image.at_rest))
        image.gathers = refinement.active or still

    def _only_rays_help(self, before: Event | None, expected: Event) -> bool:
        """Whether nothing moves, and the image is coarse or being swept."""
        if not self._refines or not self._layer.reprojects or expected is not self.view.event:
            return False
        stood = before is not None and before.number == expected.number
        return self.refinement.active or (stood and not self.whole)

    @property
    def whole(self) -> bool:
        """Whether it is made of all pixels."""
        return self.reconstruction.scale == 1

    @property
    def complete(self) -> bool:
        """Whether all that came is shown, at full resolution, and has been sent."""
        return self.rests and self.whole and self._composition.idle

    def oldest_sample_at(self, now: float) -> float:
        """When the oldest sample shown was traced, seconds of the head's clock; -1 while a pixel never had one."""
        age = self._layer.oldest_sample(now)
        return -1.0 if age is None else now - age


class RendererImage:
    """The images of a rank's regions, and what other ranks need of them."""

    def __init__(self, plan: Plan, rank: int, ready: Ready, clock: Clock, shares: Shares = shares_nothing) -> None:
        """`clock`: tells how long refreshes take."""
        self.composition = Composition(plan, rank, ready, shares=shares)
        self.images = tuple(OwnImage(plan, r, self.composition, clock) for r in plan.layout.regions_of(rank))
        self.updates = UpdatesShown()
        self.barrier = plan.layout.config.barrier
        self.rounds = 0  # refreshes of all views at once, with a barrier
        self._spent = 0.0  # seconds, in all rounds
        self.number = NEVER  # of the events of the last round, see summed_number

    def on_tick(self, now: float) -> Iterator[Offer]:
        """Refresh what is due, and offer what others need as far as there is credit; with a barrier all or nothing."""
        together = self.barrier and now >= self.due
        for image in self.images if together or not self.barrier else ():
            active = sum(other.weight for other in self.images if other is image or not other.rests)
            event = image.view.event
            if not image.refresh(now, 1.0 if together else image.weight / active) or event is None:
                continue
            self.updates.show(event.view, event.scene_event)
            if event.statistics:
                yield from self.composition.offer_statistics(now)
        if together:
            self._end_round(now)
        yield from self.composition.send()

    def _end_round(self, now: float) -> None:
        """All views were refreshed from `now` on: that takes no more of the time than without a barrier."""
        self.rounds, self.number = self.rounds + 1, summed_number(image.view.event for image in self.images)
        spent = sum(image.refreshing_s for image in self.images)
        took, self._spent = spent - self._spent, spent
        for image in self.images:
            image.view.due = max(image.view.due, now + took / SHARE_OF_TIME)

    @property
    def hurries(self) -> bool:
        """Whether a camera has jumped to what no image shows yet."""
        return any(image.refinement.first for image in self.images)

    @property
    def due(self) -> float:
        """When the next refresh is due, seconds of the head's clock; with a barrier, when the last view's is."""
        return (max if self.barrier else min)(image.view.due for image in self.images)

    def oldest_sample_at(self, now: float) -> float:
        """That of the first region, see OwnImage."""
        return self.images[0].oldest_sample_at(now)


def image_at(
    plan: Plan, rank: int, ready: Ready, clock: Clock, shares: Shares = shares_nothing
) -> RendererImage | None:
    """The images that a renderer makes. None where its samples travel to a compositor."""
    at_renderer = [plan.layout.layer(region).at_renderer for region in plan.layout.regions_of(rank)]
    return RendererImage(plan, rank, ready, clock, shares) if at_renderer and all(at_renderer) else None
