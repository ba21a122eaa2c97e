"""What `wall check` expects of a whole wall, from the rate of one core: samples, bytes into compositors, and notes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from wall.commands.one_core import OneCore
from wall.commands.terminal import si
from wall.roles.plan import Layout, why_not_at_renderer
from wall.roles.renderer_image import SHARE_OF_TIME

LINK_BYTES_PER_S = 1.25e9  # of 10 Gbit/s
FEW = 1.0  # samples a pixel and second: with less, even an image that nothing moves takes a second and more
DISPLAY_BYTES = 3  # of a pixel on its way to be shown


def expected(layout: Layout, core: OneCore, cores: int) -> Iterator[str]:
    """Yield lines about the wall, the last ones notes of what is too much. `cores`: of this machine."""
    rate = core.rate
    threads = {rank: _threads(layout, rank) for rank in layout.renderers()}
    together, pixels = sum(threads.values()), sum(map(layout.area_of, layout.renderers()))
    here = rate * min(together, cores)
    fewer = f"; {si(here).strip()} samples/s, {_few(here / pixels)} a pixel, on the {cores} cores here"
    yield (
        f"expected of the wall at most: {si(rate * together).strip()} samples/s if each of {together} threads has a "
        f"core like this one, {_few(rate * together / pixels)} a pixel and second{fewer * (together > cores)}"
    )
    if core.refresh_s and not why_not_at_renderer(layout, layout.layer(layout.region(layout.renderers()[0]))):
        yield _in_motion(layout, core, together, cores)
    if rate * together / pixels < FEW:
        yield (
            f"note: all pixels are traced once in {pixels / (rate * together):.2g} s at best: fewer pixels, or more "
            "ranks on more machines (graph: {ranks_per_panel: 2})"
        )
    yield from _into_compositors(layout, threads, rate * core.size)


def _in_motion(layout: Layout, core: OneCore, together: int, cores: int) -> str:
    """Images/s and samples/s while all of the picture moves, with a core for each thread and on those that are here."""
    hz = layout.config.views[layout.region(layout.renderers()[0]).view].refresh_hz
    busy, said = together + layout.graph.compositors, []  # what competes for cores
    for share in dict.fromkeys((1.0, min(1.0, cores / busy))):
        images = min(hz, SHARE_OF_TIME * share / core.refresh_s)
        samples = core.rate * together * (share - images * core.refresh_s)
        said.append(f"{_few(images)} of {hz:g} images/s and {si(samples).strip()} samples/s")
    here = f"; {said[-1]} on the {cores} cores here" * (busy > cores)
    return f"expected while everything moves: about {said[0]} if each thread has a core{here}"


def _into_compositors(layout: Layout, threads: dict[int, int], rate: float) -> Iterator[str]:
    """Notes of compositors that more comes to than a link carries; `rate`: bytes/s of samples from one core."""
    samples, images = Counter[int](), Counter[int]()
    for rank in layout.renderers():
        for target in {layout.layer(region).compositor for region in layout.regions_of(rank)}:
            samples[target] += round(rate * threads[rank])
    for layer in layout.graph.layers:
        if not why_not_at_renderer(layout, layer):
            width, height = layout.wall.traced[layer.traced].pixels
            hz = layer.refresh_hz or layout.config.views[layer.view].refresh_hz
            images[layer.compositor] += round(DISPLAY_BYTES * width * height * hz)
    share = f"more compositors (graph: {{compositors: {layout.graph.compositors + 1}}})"
    if layout.graph.compositors >= len(layout.wall.panels):
        share = "smaller panels"
    for what, into, remedy in (
        ("samples", samples, f"{share}, or transport: {{codec: zstd}}"),
        ("images, if all of them change", images, f"{share} on the machines that show them, or a lower refresh_hz"),
    ):
        most = max(into, key=lambda rank: into[rank], default=0)
        others = sum(each > LINK_BYTES_PER_S for each in into.values()) - 1
        if others >= 0:
            yield (
                f"note: rank {most} takes in {si(into[most])}B/s of {what}, more than the {si(LINK_BYTES_PER_S)}B/s of "
                f"a 10 Gbit/s link{f' (so do {others} others)' * (others > 0)}: {remedy}"
            )


def _few(value: float) -> str:
    """Two digits, and no exponent."""
    return f"{value:.2g}" if value < 100.0 else f"{value:.0f}"


def _threads(layout: Layout, rank: int) -> int:
    return max(layout.sampling_of(view).threads for view in layout.views_of(rank))
