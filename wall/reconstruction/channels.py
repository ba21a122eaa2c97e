"""Fill a layer's framelet: colour and the channels that compositing needs. Only what changed is written."""

from __future__ import annotations

from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from wall.core.data import Channels, Event, Float32, Float64, Framelet, Rect, Samples
from wall.core.kernels.tone_mapping import NONE, map_tiles
from wall.core.tone_mapping import AS_IT_IS, Tone, tone_mapped
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.pixel_buffer import PixelBuffer
from wall.deepbuffer.pose import Posed
from wall.geometry.panels import Panel
from wall.reconstruction.choice import LayerReconstruction
from wall.reconstruction.display_values import update_display
from wall.reconstruction.gpu.reconstruction import GpuReconstruction
from wall.reconstruction.kernels import channels as kernels
from wall.reconstruction.reconstruction import Reconstruction
from wall.scene.kernels.environment import environment_of_panel
from wall.scene.model import Environment, Sky


def blank_framelet(panel: Panel, channels: Channels, *, encoded: bool, order: int) -> Framelet:
    """A panel's framelet at its rectangle of the frame, before any sample came."""
    rect = Rect(x=panel.screen[0], y=panel.screen[1], width=panel.pixels[0], height=panel.pixels[1])
    return Framelet.blank(rect, channels, encoded=encoded, order=order)


def show_newest(
    buffer: PixelBuffer, dirty: NDArray[np.bool_], transparent: bool, out: Framelet, *, tone: Tone = AS_IT_IS
) -> None:
    """Bring the dirty tiles of `out` to what each pixel's newest sample shows, exposed and mapped by `tone`."""
    if out.encoded:
        update_display(buffer.radiance, dirty, TILE, out.colour, tone=tone)
    kernels.channels_of_records(
        buffer.records, dirty, out.time_origin, transparent, tone.gain, None if out.encoded else out.colour,
        out.depth, out.alpha, out.time, out.object_id,
    )  # fmt: skip
    _map_tones(out, dirty, tone)


def _map_tones(out: Framelet, dirty: NDArray[np.bool_], tone: Tone) -> None:
    """Map the dirty tiles of exposed light; display bytes are made of mapped light already."""
    if tone.code != NONE and not out.encoded:
        map_tiles(out.colour, out.alpha, dirty, TILE, tone.code)


class Coverage:
    """The share of every pixel that objects cover: a second image of the same samples, 1 where they hit something.

    So edges are filtered as the image's own are: colours come times this alpha, and what lies behind may be added.
    """

    def __init__(self, image: LayerReconstruction) -> None:
        """`image`: empty, see choice.Made."""
        self.image = image

    def split(self, samples: Samples) -> tuple[Samples, Samples]:
        """Split samples into those of colours without the background, and those of coverage."""
        hit = (samples["object_id"] != 0)[:, None]
        colours, covered = samples.copy(), samples.copy()
        colours["radiance"] = np.where(hit, samples["radiance"], np.float32(0.0))
        covered["radiance"] = hit.astype(np.float32)
        return colours, covered

    def insert(self, covered: Samples, base_time: float, event: Posed) -> None:
        """Store samples of coverage, see split. Raises GpuError if the GPU is lost."""
        self.image.insert(covered, base_time, event)

    def refresh(self, event: Event, now: float) -> NDArray[np.bool_]:
        """Show the samples under `event`. Returns the tiles that changed, (rows, columns) bool.

        Raises GpuError if the GPU is lost.
        """
        self.image.refresh(event, now)
        return self.image.take_dirty()

    @property
    def radiance(self) -> Float32:
        """(h, w, 3) float32: the share of each pixel that objects cover, three times."""
        return self.image.radiance


def show_reprojected(
    image: LayerReconstruction, coverage: Coverage | None, dirty: NDArray[np.bool_], out: Framelet, *,
    tone: Tone = AS_IT_IS,
) -> None:  # fmt: skip
    """Bring the dirty tiles of `out` to an image of reprojected samples, exposed and mapped by `tone`.

    Of an image on a GPU only the channels of `out` travel. Raises GpuError if the GPU is lost.
    """
    covers = None if coverage is None else coverage.image
    if isinstance(image, GpuReconstruction) and image.on_gpu and _stays(covers):
        image.write_channels(covers, out, tone=tone)
        dirty = np.ones_like(dirty)  # all of it is light again
    else:
        _show_tiles(image, coverage, dirty, out, tone)
    _map_tones(out, dirty, tone)
    surfaces = image.surfaces if isinstance(image, Reconstruction) else None  # those of paths
    if surfaces is not None and out.albedo is not None and out.normal is not None:
        surfaces.write(out.albedo, out.normal)
    if out.time is not None:
        image.write_newest_times(out.time_origin, out.time)


def _stays(covers: LayerReconstruction | None) -> TypeGuard[GpuReconstruction | None]:
    """Whether an image that colours go with is on the GPU, or there is none."""
    return covers is None or (isinstance(covers, GpuReconstruction) and covers.on_gpu)


def _show_tiles(
    image: LayerReconstruction, coverage: Coverage | None, dirty: NDArray[np.bool_], out: Framelet, tone: Tone
) -> None:
    """Bring the dirty tiles of colour, depth, object id and alpha up to date, on the CPU."""
    if out.encoded:
        image.display(dirty, out.colour, tone=tone)
    else:
        kernels.copy_tiles(image.radiance, dirty, tone.gain, out.colour)
    if out.channels & {"depth", "object_id", "alpha"}:
        pose, covered = image.pose, None if coverage is None else coverage.radiance
        depth = out.depth if out.depth is not None else np.empty(out.colour.shape[:2], np.float32)
        kernels.channels_of_nearest(
            image.find_nearest(), pose.frame, pose.corner, covered, dirty, out.colour, out.alpha, depth, out.object_id
        )


def show_sky(
    sky: Sky,
    environment: Environment | None,
    pose_frame: Float64,
    corner: Float64,
    out: Framelet,
    *,
    tone: Tone = AS_IT_IS,
    strength: float | None = None,
) -> None:
    """Bring a framelet to the sky, or the environment, that its pixels see, exposed and mapped by `tone`.

    strength : of the environment; None: as configured
    """
    gain = 2.0**tone.stops
    linear = out.colour if not out.encoded else np.empty(out.colour.shape, np.float32)
    if environment is not None:
        environment_of_panel(pose_frame, corner, environment.texels, environment.middle, linear)
        linear *= gain if strength is None else gain * float(environment.gain(strength))
    else:
        colours = [gain * np.array(c, np.float64) for c in (sky.zenith, sky.horizon, sky.ground)]
        kernels.sky_of_panel(pose_frame, corner, *colours, linear)
    if tone.code != NONE:
        linear[...] = tone_mapped(linear, tone.mapping)
    if out.encoded:
        rows, columns = -(-linear.shape[0] // TILE), -(-linear.shape[1] // TILE)
        update_display(linear, np.ones((rows, columns), np.bool_), TILE, out.colour)
    if out.alpha is not None:
        out.alpha[...] = 1.0
