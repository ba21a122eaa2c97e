"""Tiles of a moving image in which nothing can change: there samples are taken, and pixels judged, as at rest.

While the camera and the lights stand, a surface looks different only where an object that moves is seen, shades it, or
is mirrored. Spheres about those objects say where that may be. In all other tiles no sample contradicts the image, and
pixels are complete once their mean is known well enough. Only for an image that its own sampler shows: another one
would lose its oldest samples there, and get no new ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.deepbuffer.deep_buffer import DeepBuffer
from wall.deepbuffer.kernels.accumulation import limit_counts_in
from wall.deepbuffer.kernels.still import mark_reached, note_depths, renew, settle
from wall.deepbuffer.rest import OTHER_MOMENTS
from wall.scene.bounds import local_box
from wall.scene.build import Scene
from wall.scene.model import Moment

MOST_MOVERS = 64  # at once; of more no sphere is looked at, and no tile is still
HOLD_S = 0.5  # after which a tile that nothing reaches any more is still
STEPS_ASIDE = 2.0  # from one image to the next: samples may be of so much earlier, or later, moments
RENEW_EVERY = 2  # refreshes
OLDEST_S = 0.034  # samples of still tiles count as no older, so that others do not drive them out
MARGIN = 1.01  # of radii: vertices are rounded


class StillTiles:
    """Of one image. `update` at each refresh that shows another event than the one before."""

    def __init__(self, scene: Scene, buffer: DeepBuffer) -> None:
        """Only for scenes that `can_have` them."""
        self._scene, self._buffer, self._poses = scene, buffer, buffer.poses
        self._history = history = buffer.history
        shape = history.dirty.shape
        self._depths = np.empty((*history.nearest.shape[:2], 2), np.float32)
        self._mirrored = np.zeros(history.nearest.shape[:2], np.bool_)
        self._reached_at = np.zeros(shape)
        self._spans_moments = np.zeros(shape, np.bool_)  # reached since pixels began to accumulate
        self._materials = [scene.meshes[each.mesh].material for each in scene.instances]
        self._mirrors = np.zeros(len(self._materials) + 1, np.uint8)
        self._spheres: dict[int, tuple[Float64, float]] = {}  # of meshes: centre in object space, radius
        self._before: Float64 | None = None  # (n, 4, 4) world_from_object of the image before
        self._renew_in, self._knows = RENEW_EVERY, True
        self.forget(-HOLD_S, spans_moments=False)
        self._compile()

    @staticmethod
    def can_have(scene: Scene) -> bool:
        """Whether light stands, and comes straight from its sources."""
        lights = bool((scene.tracks.bodies >= len(scene.instances)).any())
        noisy = scene.path_depth is not None
        return bool(scene.tracks) and not (lights or noisy or scene.series or scene.parameter_tracks)

    def forget(self, now: float, *, spans_moments: bool) -> None:
        """No tile is still at `now`, seconds. `spans_moments`: pixels keep what they accumulated until now."""
        self._reached_at[:] = now
        if self._knows:
            self._knows = False
            self._depths[:] = np.inf, 0.0
            self._mirrored[:] = False
            self._before = None
            self._history.still[:], self._history.settled[:] = False, False
        self._spans_moments[:] = spans_moments

    def update(self, now: float) -> None:
        """Find them for the event shown. now : seconds of the buffer's clock"""
        poses, history, epoch = self._poses, self._history, self._buffer.epoch
        if poses.camera_moved or poses.doubted is not None or poses.rows is not None:
            self.forget(epoch + now, spans_moments=not poses.camera_moved)
            return
        if not self._knows:
            self._knows, materials = True, poses.materials
            self._mirrors[1:] = [materials[k].mirror > 0.0 for k in self._materials]
        note_depths(history.nearest, self._mirrors, self._depths, self._mirrored)
        reached = self._reached(poses.moved())
        self._reached_at[reached] = epoch + now
        self._spans_moments |= reached
        still = self._reached_at <= epoch + now - HOLD_S
        if (fresh := still & ~history.still).any():
            limit_counts_in(fresh & self._spans_moments, history.accumulation, OTHER_MOMENTS)
            history.temporal_gradient[fresh], history.dirty[fresh] = 0.0, True
            self._spans_moments &= ~fresh
        history.still[:] = still
        settle(still, self._mirrored, history.settled)
        self._renew_in -= 1
        if self._renew_in <= 0:
            self._renew_in = RENEW_EVERY
            renew(self._buffer.store, self._buffer.count, still, np.float32(now - OLDEST_S))

    @property
    def bytes(self) -> int:
        """Memory of its arrays."""
        return sum(array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray))

    def _compile(self) -> None:
        """Compile what is not needed at once."""
        history, tiles = self._history, np.zeros_like(self._history.still)
        limit_counts_in(tiles, history.accumulation, OTHER_MOMENTS)
        note_depths(history.nearest, self._mirrors, self._depths, self._mirrored)
        mark_reached(self._depths, np.eye(3), 0.0, 0.0, np.empty((0, 4)), np.empty((0, 4)), tiles)
        settle(tiles, self._mirrored, history.settled)
        renew(self._buffer.store, 0, tiles, np.float32(0.0))

    def _reached(self, moved: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """(rows, columns) bool: tiles that an object that moved may change. moved : (n + 1,), see PoseTracker"""
        movers = np.flatnonzero(moved[1:])
        reached = np.zeros_like(self._history.still)
        shown, pose = self._poses.shown, self._poses.pose
        assert shown is not None
        assert pose is not None
        moment, eye = self._scene.at(shown.scene_time, shown.edits), np.array(shown.camera.origin())
        now, before = moment.world_from_object, self._before
        self._before = now
        if len(movers) == 0:
            return reached
        if len(movers) > MOST_MOVERS or before is None:
            return ~reached
        rect, (x, y) = self._poses.rect, pose.corner.tolist()
        mark_reached(
            self._depths, pose.frame, x + rect.x, y + rect.y, self._spheres_of(movers, now, before) - (*eye, 0.0),
            _lights(moment, eye), reached,
        )  # fmt: skip
        return with_neighbours(reached)

    def _spheres_of(self, movers: NDArray[np.intp], now: Float64, before: Float64) -> Float64:
        """(m, 4) about where objects are, were at the last image, and will be; both (n, 4, 4) world_from_object."""
        spheres = np.empty((len(movers), 4))
        for row, k in enumerate(movers.tolist()):
            centre, radius = self._sphere(self._scene.instances[k].mesh)
            places = [each[:3, :3] @ centre + each[:3, 3] for each in (now[k], before[k])]
            size = max(np.linalg.norm(each[:3, :3], 2) for each in (now[k], before[k]))
            spheres[row, :3] = places[0]
            spheres[row, 3] = MARGIN * radius * size + STEPS_ASIDE * np.linalg.norm(places[0] - places[1])
        return spheres

    def _sphere(self, mesh: int) -> tuple[Float64, float]:
        """Centre, in object space, and radius of a sphere about a mesh."""
        if mesh not in self._spheres:
            low, high = (np.asarray(corner, np.float64) for corner in local_box(self._scene.meshes[mesh]))
            origin = np.asarray(self._scene.meshes[mesh].origin)
            self._spheres[mesh] = origin + (low + high) / 2.0, float(np.linalg.norm(high - low) / 2.0)
        return self._spheres[mesh]


def with_neighbours(tiles: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(rows, columns) bool: these tiles and the eight around each."""
    wide = tiles.copy()
    wide[:, 1:] |= tiles[:, :-1]
    wide[:, :-1] |= tiles[:, 1:]
    grown = wide.copy()
    grown[1:] |= wide[:-1]
    grown[:-1] |= wide[1:]
    return grown


def _lights(moment: Moment, eye: Float64) -> Float64:
    """(l, 4) as kernels.still takes them."""
    places = np.concatenate([moment.point_positions, moment.spot_positions]).reshape(-1, 3) - eye
    directions = moment.directions.reshape(-1, 3)
    kinds = np.concatenate([np.ones(len(places)), np.zeros(len(directions))])
    return np.ascontiguousarray(np.column_stack([np.concatenate([places, directions]), kinds]))
