"""What each rank of a plan needs of memory, worked out before any of it is taken.

Stores count as full and images as whole: what a wall takes that runs for long, and comes to rest. Not counted is what
viewers add: another sampler that they choose or compare with, their pages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from wall.compositing.graph import Layer, Step
from wall.config.graph import SinkNode
from wall.config.sampling import AdaptiveSampling
from wall.core.data import SAMPLE, Region
from wall.deepbuffer.deep_buffer import SAMPLES_PER_PIXEL
from wall.deepbuffer.kernels.pixel_buffer import PIXEL
from wall.deepbuffer.still_tiles import StillTiles
from wall.operators.base import Operator
from wall.packets.framelets import MAX_RAW, bytes_a_pixel
from wall.reconstruction.memory import Kept, dynamic_bytes, reconstruction_bytes
from wall.roles.edges import needed_from_others
from wall.roles.plan import Plan
from wall.roles.reprojected_layer import threads_of
from wall.roles.resolution import FEWEST, scale_for
from wall.scene.needs import needs
from wall.tracing.memory import scene_bytes

# Resident memory of a renderer of one panel of 480x270 and of its head on x86-64 Linux, Python 3.11, less what is
# counted below: 116 MB of mapped files, which processes share, and 110 MB of modules and kernels in each. A process
# that was forked shares those too; what it writes to of them, with what it allocates besides, was 22 to 37 MB.
LIBRARIES = 116_000_000  # once a machine
PROCESS = 110_000_000  # of each process that loads all by itself
FORKED = 30_000_000  # of each that was forked
OF_AN_INSTANCE = 600  # bytes a thread: 579 in the forest of 1,453, for its tree and tables
ARRIVED = 8  # bytes of a pixel: when it was traced last
# bytes of a pixel of its region that a sampler remembers, see sampling/
OF_A_SAMPLER = {"adaptive": 19, "framed": 8, "frameless": 16, "hilbert": 32, "progressive": 64 + SAMPLE.itemsize}
SHOWN = 2 * 3  # bytes of a pixel of a sink: what it shows, and the image that follows it


@dataclass(frozen=True, slots=True, kw_only=True)
class RankMemory:
    """Bytes that one rank needs beside the scene and its program."""

    rank: int
    images: int = 0  # samples that are kept, and images made of them
    framelets: int = 0  # of nodes, from other ranks, and at sinks
    sampling: int = 0  # what samplers and tracers remember
    shared: int = 0  # memory through which images go to other ranks of its machine

    @property
    def own(self) -> int:
        """All of it."""
        return self.images + self.framelets + self.sampling + self.shared


@dataclass(frozen=True, slots=True, kw_only=True)
class HostMemory:
    """Bytes that some ranks need on one machine, by what they are for."""

    programs: int
    scene: int
    ranks: tuple[RankMemory, ...]

    @property
    def total(self) -> int:
        """All of it."""
        return self.programs + self.scene + sum(rank.own for rank in self.ranks)


def memory_of(plan: Plan, rank: int) -> RankMemory:
    """What a rank needs. `plan`: with layers reconstructed where they will be."""
    graph = plan.layout.graph
    layers = [layer for layer in graph.layers if layer.compositor == rank]
    images = sum(_layer_bytes(plan, layer) for layer in layers)
    framelets = sum(_framelets(plan, layer) for layer in layers)
    framelets += sum(_step_bytes(step) for step in graph.steps if step.rank == rank)
    framelets += sum(_pixels(step) * _pixel(step) for step in needed_from_others(graph, rank))
    sampling = shared = 0
    if plan.layout.role(rank) == "renderer":
        regions = plan.layout.regions_of(rank)
        images += sum(_sampler_store(plan, region) for region in regions)
        sampling = sum(_sampling(plan, region) for region in regions)
        shared = sum(_ring(plan, layer) for layer in layers)
    return RankMemory(rank=rank, images=images, framelets=framelets, sampling=sampling, shared=shared)


def memory_on_host(plan: Plan, ranks: Sequence[int], *, forked: bool) -> HostMemory:
    """What some ranks need on one machine. `forked`: of one process that has loaded all; else each loads its own."""
    processes = 1 if forked else len(ranks)
    programs = LIBRARIES + processes * PROCESS + forked * len(ranks) * FORKED
    found = tuple(memory_of(plan, rank) for rank in ranks)
    return HostMemory(programs=programs, scene=processes * scene_bytes(plan.scene), ranks=found)


def kept_by(plan: Plan, view: int, *, threads: int = 1) -> Kept:
    """What an image of a view keeps of its samples."""
    sampling, wanted = plan.layout.sampling_of(view), needs(plan.scene_of(view))
    most = sampling.samples_per_pixel if isinstance(sampling, AdaptiveSampling) else SAMPLES_PER_PIXEL
    return Kept(
        lit=wanted.relighting, noisy=wanted.paths, detects_change=wanted.change_detection, samples_per_pixel=most,
        threads=threads,
    )  # fmt: skip


def _layer_bytes(plan: Plan, layer: Layer) -> int:
    """Of a layer where it is reconstructed: the newest sample of each pixel, and what is reprojected."""
    panel = plan.layout.wall.traced[layer.traced]
    width, height = panel.pixels
    method = plan.layout.sampling_of(layer.view).method
    found = (PIXEL.itemsize + ARRIVED) * width * height
    if method == "framed":
        found += (SAMPLE.itemsize + 1) * width * height  # of the frame that is not complete
    if method != "adaptive" and not layer.reprojects:
        return found
    kept = kept_by(plan, layer.view, threads=threads_of(plan, layer))
    if layer.at_renderer:
        settled = replace(kept, settles=StillTiles.can_have(plan.scene_of(layer.view)))
        return found + dynamic_bytes(width, height, scale_for(panel, FEWEST), settled)
    if plan.layout.config.reconstruction_of(layer.view) == "gpu":
        return found
    return found + (1 + layer.transparent) * reconstruction_bytes(width, height, kept)


def _sampler_store(plan: Plan, region: Region) -> int:
    """Of the deep buffers of a region's own, which its sampler looks at; none where it makes the image itself."""
    sampling = plan.layout.sampling_of(region.view)
    if not isinstance(sampling, AdaptiveSampling) or plan.layout.layer(region).at_renderer:
        return 0
    rows = -(-region.rect.height // sampling.threads)
    return sampling.threads * reconstruction_bytes(region.rect.width, rows, kept_by(plan, region.view))


def _sampling(plan: Plan, region: Region) -> int:
    sampling = plan.layout.sampling_of(region.view)
    instances = sampling.threads * OF_AN_INSTANCE * len(plan.scene.instances)
    return OF_A_SAMPLER[sampling.method] * region.rect.area + instances


def _framelets(plan: Plan, layer: Layer) -> int:
    """Of a layer's framelet, and of those between it and a layer of its own rate or resolution."""
    step = plan.layout.graph.step(layer.node)
    between = (layer.scale < 1.0) + (layer.refresh_hz is not None)
    width, height = plan.layout.wall.traced[layer.traced].pixels
    light = bytes_a_pixel(step.channels | {"depth", "object_id"}, encoded=False)
    return _pixels(step) * _pixel(step) + between * light * width * height


def _step_bytes(step: Step) -> int:
    """Of an operator's framelet, or of what a sink shows."""
    if isinstance(step.node, SinkNode):
        return SHOWN * _pixels(step)
    light = 3 * 4 if step.encoded and step.computes else 0  # what it computes with
    return (_pixel(step) + light) * _pixels(step) if isinstance(step.node, Operator) else 0


def _ring(plan: Plan, layer: Layer) -> int:
    """Of the memory through which a renderer's image goes, see transport.zeromq."""
    step = plan.layout.graph.step(layer.node)
    image = min(_pixels(step) * _pixel(step), MAX_RAW)
    return 2 * max(image, plan.layout.config.transport.credit_bytes)


def _pixels(step: Step) -> int:
    return step.rect.area


def _pixel(step: Step) -> int:
    return bytes_a_pixel(step.channels, encoded=step.encoded)
