"""Tiles of a moving image in which nothing can change: there no new sample contradicts the image.

While the camera and the lights stand, a surface looks different only where an object that moves is seen, shades it, or
is mirrored. Spheres about those objects say where that may be. In all other tiles samples that differ from the image
are noise: what pixels accumulate grows as in a still view.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Float64
from wall.core.threads import Threads
from wall.deepbuffer.deep_buffer import DeepBuffer
from wall.deepbuffer.kernels.still import forget_depths, mark_reached, note_depths, settle
from wall.deepbuffer.rest import limit_means
from wall.scene.bounds import local_box
from wall.scene.build import Scene
from wall.scene.model import Moment
from wall.scene.needs import needs

MOST_PAIRS = 16  # of an object that moves and a light: of more none is looked at, and no tile is still
HOLD_S = 0.5  # after which a tile that nothing reaches any more is still
STEPS_ASIDE = 2.0  # of an object, from image to image: samples may be of moments so much earlier, or later
NOTHING_SEEN = np.array([np.inf, 0.0], np.float32)  # range of depths
MARGIN = 1.01  # of radii: vertices are rounded


class StillTiles:
    """Of one image. `update` at each refresh that shows another event than the one before."""

    def __init__(self, scene: Scene, buffer: DeepBuffer, threads: Threads) -> None:
        """Only for scenes that `can_have` them."""
        self._scene, self._buffer, self._poses = scene, buffer, buffer.poses
        self._history, self._threads = buffer.history, threads
        history = buffer.history
        shape = history.dirty.shape
        self._depths = np.empty((*history.nearest.shape[:2], 2), np.float32)
        self._mirrored = np.zeros(history.nearest.shape[:2], np.bool_)
        self._reached_at = np.zeros(shape)
        self._spans_moments = np.zeros(shape, np.bool_)  # reached since pixels began to accumulate
        self._mirrors = buffer.poses.mirrors
        self._spheres: dict[int, tuple[Float64, float]] = {}  # of meshes: centre in object space, radius
        self._before: Float64 | None = None  # (n, 4, 4) world_from_object of the image before
        self._lights = len(scene.point_lights) + len(scene.spot_lights) + len(scene.directional_lights)
        self._learned = True  # depths, and which objects are mirrors
        self._forget(-HOLD_S, spans_moments=False)
        self._compile()

    @staticmethod
    def can_have(scene: Scene) -> bool:
        """Whether light stands and comes straight from its sources, and no surface lets any through."""
        lights = bool((scene.tracks.bodies >= len(scene.instances)).any())
        wanted = needs(scene)
        return bool(scene.tracks) and not (
            lights or wanted.paths or wanted.occlusion or wanted.alpha or scene.series or scene.parameter_tracks
        )

    def _forget(self, now: float, *, spans_moments: bool) -> None:
        """No tile is still at `now`, seconds. `spans_moments`: pixels keep what they accumulated until now."""
        self._reached_at[:], self._spans_moments[:] = now, spans_moments
        if self._learned:
            self._learned, self._before = False, None
            self._depths[:], self._mirrored[:] = NOTHING_SEEN, False
            self._history.still[:], self._history.settled[:] = False, False

    def update(self, moved: NDArray[np.uint8], now: float) -> None:
        """Find them for the event shown. moved : (n + 1,), see PoseTracker; now : seconds of the buffer's clock"""
        poses, history, seconds = self._poses, self._history, self._buffer.epoch + now
        movers = np.flatnonzero(moved[1:])
        many = len(movers) * max(1, self._lights) > MOST_PAIRS
        if many or poses.camera_moved or poses.doubted is not None or poses.rows is not None:
            self._forget(seconds, spans_moments=not poses.camera_moved)
            return
        if not self._learned:
            self._learned, self._mirrors = True, poses.mirrors
        note_depths(history.nearest, self._mirrors, self._depths, self._mirrored)
        reached = self._reached(movers)
        self._reached_at[reached] = seconds
        self._spans_moments |= reached
        still = self._reached_at <= seconds - HOLD_S
        if (left := still & ~history.still & self._spans_moments).any():
            limit_means(history, left)
            forget_depths(left, self._depths, self._mirrored)  # some were those of what moved
            note_depths(history.nearest, self._mirrors, self._depths, self._mirrored)
            self._spans_moments &= ~left
        history.temporal_gradient[still] = 0.0
        history.still[:] = still
        settle(still, self._mirrored, history.settled)

    @property
    def bytes(self) -> int:
        """Memory of its arrays."""
        return sum(array.nbytes for array in vars(self).values() if isinstance(array, np.ndarray))

    def _compile(self) -> None:
        """Compile what is not needed at once."""
        history, tiles = self._history, np.zeros_like(self._history.still)
        note_depths(history.nearest, self._mirrors, self._depths, self._mirrored)
        mark_reached(self._depths, np.eye(3), 0.0, 0.0, np.empty((0, 4)), np.empty((0, 4)), 0, 0, tiles)
        settle(tiles, self._mirrored, history.settled)
        forget_depths(tiles, self._depths, self._mirrored)

    def _reached(self, movers: NDArray[np.intp]) -> NDArray[np.bool_]:
        """(rows, columns) bool: tiles that one of these instances (m,) may change, which have moved."""
        reached = np.zeros_like(self._history.still)
        shown, pose = self._poses.shown, self._poses.pose
        assert shown is not None
        assert pose is not None
        moment, eye = self._scene.at(shown.scene_time, shown.edits), np.array(shown.camera.origin())
        now, before = moment.world_from_object, self._before
        self._before = now
        if before is None:
            return ~reached
        rect, (x, y) = self._poses.rect, pose.corner.tolist()
        spheres, lights = self._spheres_of(movers, now, before) - (*eye, 0.0), _lights(moment, eye)
        self._threads.share(
            len(reached),
            lambda first, last: mark_reached(
                self._depths, pose.frame, x + rect.x, y + rect.y, spheres, lights, first, last, reached
            ),
        )
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
    return np.column_stack([np.concatenate([places, directions]), kinds])
