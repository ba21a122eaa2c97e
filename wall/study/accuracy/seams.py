"""Images made in parts against images made whole: the same bits."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.config.loading import loads
from wall.core.data import Float32, Rect
from wall.geometry.cameras import default_eye, look_at
from wall.geometry.panels import Wall
from wall.reconstruction.reconstruction import Reconstruction
from wall.roles.plan import make_layout, make_plan
from wall.run.single_process import SingleProcess
from wall.sampling.pixel_means import PixelMeans
from wall.study.accuracy.case import Case, Found, picture
from wall.study.accuracy.scenes import View, flat_wall, tiny_scene, traced_image, view, with_every_feature
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

CAMERAS = (
    look_at((0.0, 1.0, 5.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
    look_at((1e6, 1e5, 3e6), (1e6, 1e5 - 1.0, 0.0), (0.0, 1.0, 0.0)),  # sees the sky alone
    look_at((3.0, 2.2, 4.1), (0.0, 0.6, 0.0), (0.1, 1.0, 0.2)),
)


def panels(width: int) -> Found:
    """Pixels of 3 x 2 panels, with and without bezels, that are not those of the wall rendered whole."""
    wrong = total = 0
    scene = make_tracer_scene(with_every_feature(tiny_scene()))
    before = view((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), pixels=(1, 1)).event
    for bezel, camera in product((0.0, 0.13), CAMERAS):
        event, wall = replace(before, camera=camera), flat_wall(3, 2, (width, width * 3 // 4), bezel=bezel)
        eye = default_eye(wall, 50.0)
        first = replace(wall.panels[0], pixels=(wall.width, wall.height), screen=(0, 0))
        whole = Wall(panels=(first,), width=wall.width, height=wall.height)
        entire = traced_image(scene, View(wall=whole, eye=eye, event=event))
        for panel in wall.panels:
            part = traced_image(scene, View(wall=replace(wall, panels=(panel,)), eye=eye, event=event))
            x, y = panel.screen
            inside = np.s_[y : y + panel.pixels[1], x : x + panel.pixels[0]]
            differs = (part.radiance != entire.radiance[inside]).any(axis=2)
            differs |= (part.depth != entire.depth[inside]) | (part.objects != entire.objects[inside])
            wrong, total = wrong + int(differs.sum()), total + differs.size
    return Found(figure=wrong, note=f"of {total:,} pixels", pictures=(picture("the wall whole", entire.radiance),))


def parts_of_an_image(width: int) -> Found:
    """Pixels of four random samples that depend on bands, on threads that share them, or on their order."""
    scene = make_tracer_scene(replace(with_every_feature(tiny_scene()), path_depth=3))
    seen = view((0.0, 2.2, 5.0), (0.0, 0.6, 0.0), pixels=(width, width))
    height, whole = width, _converged(scene, seen, [Rect(x=0, y=0, width=width, height=width)])
    wrong = 0
    for rows in (1, 3, 8):
        bands = [Rect(x=0, y=y, width=width, height=min(rows, height - y)) for y in range(0, height, rows)]
        wrong += int((_converged(scene, seen, bands[::-1]) != whole).any(axis=2).sum())
        columns = [Rect(x=x, y=0, width=min(rows, width - x), height=height) for x in range(0, width, rows)]
        wrong += int((_converged(scene, seen, columns, tracers=3) != whole).any(axis=2).sum())
    return Found(
        figure=wrong, note=f"of {6 * whole.shape[0] * whole.shape[1]:,} pixels", pictures=(picture("whole", whole),)
    )


def _converged(scene: Any, seen: View, rects: list[Rect], *, tracers: int = 1) -> Float32:
    """(h, w, 3) means of four samples a pixel, each rectangle by the next of so many tracers."""
    width, height = seen.panel.pixels
    made = [Tracer(scene, seen.panel, seen.eye, coherent=True) for _ in range(tracers)]
    image = np.zeros((height, width, 3), np.float32)
    for k, rect in enumerate(rects):
        tracer, means = made[k % tracers], PixelMeans(rect, seed=7)
        tracer.set_event(seen.event)
        for number in range(4):
            means.add(tracer.trace(means.positions(number), 0.5, number)[0])
        image[rect.y : rect.bottom, rect.x : rect.right] = means.mean()
    return image


def ranks_and_threads(width: int) -> Found:
    """Pixels of whole images by 1, 2 and 3 ranks a panel and by 1, 2 and 3 threads a rank that are not the same."""
    wrong, whole = 0, _shown(width, "frameless")
    shares = [("frameless", 2, 1), ("frameless", 3, 1), ("frameless", 1, 2), ("frameless", 1, 3), ("framed", 3, 2)]
    for method, ranks, threads in shares:
        image = _shown(width, method, ranks=ranks, threads=threads)
        wrong += int((image != (whole if method == "frameless" else _shown(width, method))).any(axis=2).sum())
    return Found(figure=wrong, note=f"of {len(shares) * whole.shape[0] * whole.shape[1]:,} pixels")


def layers(width: int) -> Found:
    """Largest difference, codes, of an image put together by depth of 2 and 3 ranks' objects from that of one rank."""
    whole = _shown(width, "framed").astype(int)
    apart = [_shown(width, "framed", ranks=ranks, more="preset: sort-last, sync: frame") for ranks in (2, 3)]
    return Found(figure=max(float(np.abs(whole - image).max()) for image in apart))


def _shown(
    width: int, method: str, *, ranks: int = 1, threads: int = 1, more: str = "preset: sort-first"
) -> NDArray[np.uint8]:
    """(h, w, 3) uint8: what a still wall of one panel ends in, all of whose samples travel."""
    text = CONFIG.format(width=width, height=width * 3 // 4, method=method, ranks=ranks, threads=threads, more=more)
    plan = make_plan(make_layout(loads(text)))
    (image,) = SingleProcess(plan, make_tracer_scene(plan.scene), at_renderers=False).until_complete()
    return np.array(image.rgb)


def threads_of_a_refresh(width: int) -> Found:
    """Pixels of an image that depend on how many threads share its refreshes, while the camera moves and at rest."""
    seen, scene = view((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), pixels=(width, width)), tiny_scene()
    tracer = Tracer(make_tracer_scene(with_every_feature(scene)), seen.panel, seen.eye, coherent=False)
    images = [
        Reconstruction(seen.panel, seen.eye, scene, detects_change=True, threads=threads) for threads in (1, 2, 3)
    ]
    wrong, random = 0, np.random.default_rng(4)
    for k in range(6):
        camera = replace(seen.event.camera, position=(0.02 * min(k, 3), 0.0, 4.0))
        event = replace(seen.event, camera=camera, camera_event=min(k, 3))
        tracer.set_event(event)
        places = random.random((width * width, 2), np.float32) * np.float32(width * (1 - 2.0**-20))
        samples = tracer.trace(places, 0.5, k)[0]
        for image in images:
            image.insert(samples.copy(), 0.1 * k, event)
            image.refresh(event, 0.1 * k + 0.05)
        wrong += sum(int((image.radiance != images[0].radiance).any(axis=2).sum()) for image in images[1:])
    return Found(
        figure=wrong, note=f"of {12 * width * width:,} pixels", pictures=(picture("at rest", images[0].radiance),)
    )


CONFIG = """\
version: 1
scene: {{source: spheres, animation: [], integrator: {{method: direct}}}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [{width}, {height}], size: [0.4, 0.3]}}}}
views: [{{camera: {{position: [0, 1, 5], target: [0, 0.5, 0], fov: 40}}, refresh_hz: 30}}]
sampling: {{method: {method}, threads: {threads}, samples_per_batch: 64}}
reconstruction: cpu
graph: {{{more}, ranks_per_panel: {ranks}, sinks: [png]}}
"""
_REASON = "a sample depends on its pixel, its number and the seed, and rays of panels in one plane are of one formula"
CASES = (
    Case(
        name="panels", family="Seams", unit="pixels", bound=0.0, reason=_REASON,
        scene="3 x 2 panels, with and without bezels, three cameras, each panel alone, against the wall as a whole",
        measure=panels, size=192, small=16,
    ),
    Case(
        name="parts_of_an_image", family="Seams", unit="pixels", bound=0.0, reason=_REASON,
        scene="Paths of random samples in bands of rows and columns, in another order, by one and by three tracers",
        measure=parts_of_an_image, size=64, small=9,
    ),
    Case(
        name="ranks_and_threads", family="Seams", unit="pixels", bound=0.0, reason=_REASON,
        scene="A still panel by 1 to 3 ranks and by 1 to 3 threads a rank, whose samples travel", size=96, small=16,
        measure=ranks_and_threads,
    ),
    Case(
        name="layers", family="Seams", unit="codes", bound=1.0,
        reason="every pixel's ray is the same and hits the same object; only the sky is computed at another place",
        scene="A still panel whose objects 2 and 3 ranks share, put together by depth, against one rank",
        measure=layers, size=96, small=16,
    ),
    Case(
        name="threads_of_a_refresh", family="Seams", unit="pixels", bound=0.0,
        reason="threads own bands of rows, and take samples in the order of the store: each sum has one order",
        scene="An image that moves and comes to rest, refreshed by 1, 2 and 3 threads", size=128, small=64,
        measure=threads_of_a_refresh,
    ),
)  # fmt: skip
