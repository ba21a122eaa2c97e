"""The poses and the shading of one image: of the event shown, the one before, and of samples as they come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Camera, Event, Float32, Float64, Rect
from wall.deepbuffer.cuts import CutTracker
from wall.deepbuffer.kernels.insert import InsertRules
from wall.deepbuffer.kernels.reproject_rows import RowTables
from wall.deepbuffer.lights import Diffuse, LightChanges
from wall.deepbuffer.pose import Pose, Posed, Poses, is_shown, same_camera
from wall.deepbuffer.shading import ShadingChanges
from wall.geometry.moving import MovingEvent, later
from wall.geometry.panels import Panel
from wall.geometry.scan import ImageScan
from wall.scene.build import Scene


class PoseTracker:
    """Tracks the poses of one image: of the event shown, the one before, and of samples as they come."""

    def __init__(
        self, panel: Panel, eye: Float64, scene: Scene, rect: Rect | None, *, lit: bool, objects: bool = True
    ) -> None:
        """`rect` is the part of the panel that is shown, all if None; `lit` and `objects`: see Poses."""
        self.rect = rect or Rect(x=0, y=0, width=panel.pixels[0], height=panel.pixels[1])
        self.lit = lit
        self.diffuse = Diffuse.of(scene)
        self.nothing_moves = False
        self.camera_moved = True  # between the last two images
        self.spans_moments = False  # pixels may have accumulated samples of several times of the scene
        self.pose: Pose | None = None  # of the image
        self.last: Pose | None = None  # before
        self.rows: RowTables | None = None  # of the image, where its rows are seen one after the other
        self._last_rows: RowTables | None = None  # before
        self._scan = ImageScan.of(panel.scan, self.rect) if panel.scan is not None else None
        self._light_changes = LightChanges(self.diffuse.objects)
        self._shading_changes, self._shading = ShadingChanges(scene), scene.shading(0.0)
        self.cuts = CutTracker(scene)
        self.doubted: NDArray[np.uint8] | None = None  # by the last `show`: see ShadingChanges; None: no edit
        self._poses = Poses(panel, eye, scene, self.rect, objects=objects, lit=lit)
        self._shown: Event | None = None

    @property
    def shown(self) -> Event | None:
        """The event of the image; None before the first."""
        return self._shown

    @property
    def mirrors(self) -> NDArray[np.bool_]:
        """(n + 1,) bool: objects that the image shows as mirrors."""
        return self._shading_changes.mirrors(self._shading.materials)

    def show(self, event: Event) -> None:
        """Show `event` from now on; nothing moves if the event before has the same number."""
        shown, self._shown = self._shown, event
        self.nothing_moves = shown is not None and event.number == shown.number
        self.camera_moved = not self.nothing_moves and (shown is None or _other_camera(event, shown))
        if not self.nothing_moves:
            began = self._scan.first if self._scan is not None else 0.0
            self.pose, self.last = self._poses.of(later(event, began)), self.pose
            self.rows, self._last_rows = self._rows_under(event), self.rows
        self._shade(event)
        self.cuts.show(event)
        if self.camera_moved:
            self.spans_moments = False  # pixels start anew
        elif shown is not None and event.scene_time != shown.scene_time:
            self.spans_moments = True

    def _shade(self, event: Event) -> None:
        """Compare the shading of `event` with that of the image before."""
        was, self._shading = self._shading, self._poses.shading(event)
        self.doubted = self._shading_changes.between(self._shading, was, self._relit)

    @property
    def _relit(self) -> NDArray[np.bool_]:
        """(n + 1,) bool: objects whose samples can be lit anew."""
        if not self.lit or self.pose is None:
            return np.zeros(len(self.diffuse.objects), np.bool_)
        return np.asarray(self.pose.lights.relightable & (self.diffuse.objects != 0))

    def doubt_of(self, event: Posed) -> NDArray[np.uint8] | None:
        """(n + 1,) uint8: objects whose samples of `event` the image doubts, which shows newer edits. Else None."""
        if self._shown is None or not _newer(self._shown, event):
            return None
        return self._shading_changes.between(self._shading, self._poses.shading(event), self._relit)

    def is_ahead(self, event: Posed) -> bool:
        """Whether samples of `event` saw edits that the image does not show yet."""
        return self._shown is not None and _newer(event, self._shown)

    def seen_by(self, camera: Camera) -> Float32:
        """(n + 1, 12) float32: panel_from_object of another camera; objects stay where they were last."""
        return self._poses.seen_by(camera)

    def inserted(self, event: Posed) -> tuple[Pose, Pose]:
        """The pose of samples that are about to be inserted, and that of the image."""
        pose = self._poses.of(event)
        under = self.pose if self.pose is not None else pose
        self.cuts.note(event)
        self._light_changes.note(pose.lights, under.lights)
        return pose, under

    def rules(
        self, event: Posed, samples_per_pixel: float, *, detects_change: bool, change_test: bool, noisy: bool = False
    ) -> InsertRules:  # fmt: skip
        """How samples of `event` are inserted into the image shown."""
        same_edits = self._shown is None or event.edits.number == self._shown.edits.number
        of_shown_pose = is_shown(event, self._shown)
        return InsertRules(
            shows_event=same_edits
            and (self.nothing_moves or not noisy)  # light may change on whatever moves
            and (of_shown_pose if self.nothing_moves else same_camera(event, self._shown)),
            ignores_change=self.nothing_moves or not change_test or not same_edits,  # edits are known without rays
            most_stored=np.float32(samples_per_pixel if self.nothing_moves else np.inf),
            detects_change=detects_change,
            of_shown_pose=of_shown_pose and self._scan is None,
            left=np.float32(self.rect.x),
            top=np.float32(self.rect.y),
        )

    def moved(self) -> NDArray[np.uint8]:
        """(n + 1,) uint8: objects whose matrix differs from that of the image before; all in the first image."""
        assert self.pose is not None
        table = self.pose.panel_from_object
        if self.nothing_moves:
            return np.zeros(len(table), np.uint8)
        if self.last is None:
            return np.ones(len(table), np.uint8)
        moved = (table != self.last.panel_from_object).any(axis=1)
        if self.rows is not None and self._last_rows is not None:
            moved |= (self.rows.last != self._last_rows.last).any(axis=1)
        return np.asarray(moved.astype(np.uint8))

    def _rows_under(self, event: Event) -> RowTables | None:
        """How the image of an event goes on to its last row; None: all rows are seen at once."""
        if self._scan is None:
            return None
        assert self.pose is not None
        ends = later(event, self._scan.last)
        return RowTables(self.pose.panel_from_object if ends is event else self._poses.table(ends), self._scan.share)

    def rows_of(self, pose: Pose) -> RowTables | None:
        """How an image of `pose` goes on to its last row: the image shown, or one that shows nothing yet."""
        if self._scan is None or pose is self.pose:
            return self.rows
        return RowTables(pose.panel_from_object, self._scan.share)

    def diffuse_under(self, pose: Pose) -> Diffuse:
        """What can be lit anew, with the sky's light of a pose."""
        return self.diffuse._replace(sky_irradiance=pose.lights.sky) if self.lit else self.diffuse

    def relit(self) -> NDArray[np.uint8]:
        """(n + 1,) uint8: objects whose stored samples are to be lit anew."""
        assert self.pose is not None
        if not self.lit or self.nothing_moves:
            return np.zeros(len(self.pose.panel_from_object), np.uint8)
        return self._light_changes.take(self.pose.lights, self.last.lights if self.last is not None else None)

    def reset(self) -> None:
        """The next event counts as another one, whatever its number."""
        self._shown = None


def _other_camera(event: Event, shown: Event) -> bool:
    """Whether two images differ by their cameras, or by how these move from row to row."""
    moving, before = (each.twist if isinstance(each, MovingEvent) else () for each in (event, shown))
    return event.camera != shown.camera or moving != before


def _newer(event: Posed, than: Posed) -> bool:
    return event.edits.number > than.edits.number
