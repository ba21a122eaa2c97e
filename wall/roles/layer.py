"""One layer of a panel at its compositor: batches in, a framelet out, only what changed is redone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Batch, Event, StatisticsImage
from wall.core.tone_mapping import Tone
from wall.reconstruction.channels import blank_framelet
from wall.reconstruction.choice import Wish
from wall.roles.handed_samples import HandedSamples
from wall.roles.layer_output import LayerOutput
from wall.roles.pixel_layer import PixelLayer, compared_layer
from wall.roles.plan import Plan
from wall.roles.reprojected_layer import ReprojectedLayer
from wall.roles.right_time import RightTimes
from wall.roles.sample_routing import Destination, SampleRouting


class PanelCompositor:
    """`follow` events, `insert` batches as they come, `refresh` at every display refresh.

    Two parts write its framelet, one at a time: `newest` shows samples where they were traced, `reprojected` where
    they are seen now. `compared` has a framelet of its own, while a second sampler is compared. A layer with a rate or
    a resolution of its own is written apart, and brought to the framelet by a LayerOutput.
    """

    def __init__(self, plan: Plan, index: int, *, reconstruction: Wish | None = None) -> None:
        """`reconstruction` overrides the configuration's. Raises GpuError if that asks for a GPU in vain."""
        graph = plan.layout.graph
        self.layer, step = graph.layers[index], graph.step(graph.layers[index].node)
        self.panel = plan.layout.wall.traced[self.layer.traced]  # whose pixels its samples are of
        self._output = LayerOutput(plan, self.layer) if self.layer.of_its_own else None
        if self._output is None:
            self.framelet = source = blank_framelet(self.panel, step.channels, encoded=step.encoded, order=step.order)
        else:
            self.framelet, source = self._output.framelet, self._output.source
        self._source = source
        self.newest = PixelLayer(self.panel, source, transparent=self.layer.transparent)
        self.counters = self.newest.buffer.counters  # of samples that this layer drops
        self.reprojected = ReprojectedLayer(plan, self.layer, source, self.counters, reconstruction)
        self.compared: PixelLayer | None = None
        self.handed: HandedSamples | None = None  # while a sink wants samples
        self.right = RightTimes()
        self.behind = False  # of a slower layer: it may show more when it is its turn
        self.edited = False  # an edit came that the next refresh shows; whoever looks sets it back
        self._edits: int | None = None  # number of the newest edits
        self._awaits: int | None = None  # number of edits that no stored sample can show
        self._answered: tuple[tuple[int, int], Tone] | None = None  # by the last reconstruction
        self._nothing = self.newest.buffer.take_dirty()  # no tile has changed
        self._routing = SampleRouting(
            plan.layout.sampling_of(self.layer.view).method, self.counters, reprojects=self.layer.reprojects
        )

    @property
    def reprojects(self) -> bool:
        """Whether the framelet shows reprojected samples."""
        return self._routing.reprojected and self.reprojected.shows

    def begin_with(self, before: PanelCompositor) -> None:
        """Show what another layer of the same pixels shows, until samples come."""
        before._show_in(self.newest, before.reprojects)

    def _show_in(self, other: PixelLayer, reprojects: bool) -> None:
        """Show in another layer of the same pixels what this one shows."""
        records, reconstruction = self.newest.buffer.records, self.reprojected.reconstruction
        if reprojects and reconstruction is not None:
            other.buffer.show_image(reconstruction.radiance, self.reprojected.arrivals.times)
        else:
            other.buffer.show_image(records["shown"], records["time"])

    def follow(self, event: Event) -> None:
        """Show the sampler that `event` names, or two. `event`: one that was published, not a predicted one."""
        self._note_edits(event.edits.number)
        was_reprojected, compare, reprojects = self._routing.reprojected, self._routing.compare, self.reprojects
        self._routing.follow(event)
        self.right.follow(event)
        if self._routing.compare != compare:
            self._compare(reprojects)
        if self._routing.reprojected != was_reprojected:
            self._switch()
        for batch in self._routing.take_early():
            self.insert(batch)

    def _note_edits(self, number: int) -> None:
        """Stored samples that are reprojected are lit anew, and moved; others show an edit once new ones come."""
        if self._edits is not None and number != self._edits and self.layer.refresh_hz is None:
            self.edited = self.edited or self.reprojects
            self._awaits = None if self.reprojects else number
        self._edits = number

    def _compare(self, reprojects: bool) -> None:
        """Begin or end a comparison, or compare with another; the samples of one that ends stay counted.

        The second image begins as the first one looks; `reprojects`: whether that showed reprojected samples.
        """
        before = self.compared
        if self.compared is not None:
            self.counters.update(self.compared.buffer.counters)
            self.newest.buffer.samples_shown += self.compared.buffer.samples_shown
        shown = None if before is None else before.framelet
        self.compared = compared_layer(self.panel, shown) if self._routing.compare else None
        if self.compared is not None:
            self._show_in(self.compared, reprojects)

    def _switch(self) -> None:
        """Change the part that is shown. What it showed stays until samples of the other sampler come."""
        reconstruction, buffer = self.reprojected.reconstruction, self.newest.buffer
        self.reprojected.show_all = reconstruction is not None
        if not self._routing.reprojected and reconstruction is not None:
            buffer.show_image(reconstruction.radiance, self.reprojected.arrivals.times)
        buffer.take_dirty()

    def hand_samples(self, wanted: bool) -> None:
        """Begin or stop to hand samples on."""
        if wanted != (self.handed is not None):
            self.handed = HandedSamples(self.panel.index, self.newest.buffer) if wanted else None
            if not wanted:
                self.newest.buffer.changed = None

    def insert(self, batch: Batch) -> None:
        """Give a batch to the image it belongs to; keep, or drop and count it where there is none."""
        self.behind = self.layer.refresh_hz is not None
        if batch.edits.number == self._awaits:
            self.edited, self._awaits = True, None
        destination = self._routing.destination(batch)
        if destination is Destination.REPROJECTED and not self.reprojected.given_up:
            self.reprojected.insert(batch)
        elif destination is not None:
            second = self.compared if destination is Destination.COMPARED else None
            (second or self.newest).buffer.insert(batch)

    def refresh(self, event: Event, now: float, *, force: bool = False) -> NDArray[np.bool_]:
        """Bring the framelet up to date. Returns the 16-pixel tiles that changed, (rows, columns) bool.

        `force`: reconstruct it, if it is not its turn either. Raises GpuError if a GPU was asked for and is lost.
        """
        output, asked = self._output, (event.number, event.tone)
        if output is None:
            return self._reconstruct(event, now)
        if output.begin(now, force=force):
            dirty = self._reconstruct(event, now)
            self._answered, self.behind = asked, self.layer.refresh_hz is not None and bool(dirty.any())
        else:
            dirty, self.behind = self._nothing, self.behind or self._answered != asked
        return output.show(dirty, event, now)

    def _reconstruct(self, event: Event, now: float) -> NDArray[np.bool_]:
        if self.reprojects:
            self.newest.buffer.take_dirty()
            dirty = self.reprojected.refresh(event, now)
            self.right.see_reprojected(event, self.reprojected.weights, self.reprojected.arrivals.times, now)
            if self.handed is not None:
                self.handed.begin_anew()
        else:
            dirty = self.newest.refresh(now, event.tone)
            self.right.see_traced(self.newest.buffer.records["key"], now)
            if self.handed is not None:
                self.handed.refresh(event.tone)
        if dirty.any():
            self._source.event = self._moment_of_newest(event) if self._output is not None else event
        return dirty

    def _moment_of_newest(self, event: Event) -> Event:
        """The event that the source shows: `event`, or where samples stay where they were traced that of the newest."""
        buffer = self.newest.buffer
        if self.reprojects or buffer.samples_shown == 0:
            return event
        (camera, scene_time, edits), (camera_event, scene_event) = buffer.newest_moment, buffer.newest_event
        return replace(
            event, camera_event=camera_event, scene_event=scene_event, camera=camera, scene_time=scene_time, edits=edits
        )

    def has_frame(self, number: tuple[int, int]) -> bool:
        """Whether every rank has brought a whole frame of that event, or of a newer one."""
        frames = self.newest.buffer.frames
        return all(rank in frames and frames[rank] >= number for rank in self.layer.ranks)

    def statistics_images(self, now: float) -> list[StatisticsImage]:
        """How old and how dense the samples are, of one sampler or of two that are compared.

        Raises GpuError if a GPU was asked for and is lost.
        """
        first = self.reprojected.statistics_image(now) if self._routing.reprojected else None
        second = [] if self.compared is None else [self.compared.statistics_image(now)]
        return [first or self.newest.statistics_image(now), *second]

    @property
    def samples_shown(self) -> int:
        """Samples that came and were used."""
        return self.newest.buffer.samples_shown + self.reprojected.arrivals.samples_shown

    @property
    def newest_event(self) -> tuple[int, int]:
        """The newest event of which a sample was used."""
        return max(self.newest.buffer.newest_event, self.reprojected.arrivals.newest_event)

    def oldest_sample(self, now: float) -> float | None:
        """Age in seconds of the oldest sample shown; None while a pixel never had one."""
        age = (self.reprojected.arrivals if self.reprojects else self.newest.buffer).oldest_sample(now)
        return age if math.isfinite(age) else None
