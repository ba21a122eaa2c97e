"""Compile the kernels that a scene needs before any rank starts, once a machine, saying so meanwhile.

numba compiles a kernel when it is first called with new argument types; here that happens on a few pixels, in an order
that lets progress be shown. A lock in the cache folder makes ranks that start together wait for one compiler.
"""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from wall.config.schema import METHODS
from wall.data import Rect, Region
from wall.jit import cache_folder, compiled_kernels
from wall.packets.samples import decode
from wall.packets.tiling import decode_tiling
from wall.processes.clock import ManualClock
from wall.processes.panel import PanelCompositor
from wall.processes.plan import Plan, first_event
from wall.processes.worker import Worker, make_samplers
from wall.tracing.resident import Resident

ENOUGH_KERNELS = 30  # in the cache: some scene has been compiled, another one may lack a few
TINY = Rect(x=0, y=0, width=8, height=8)


def warm_up(plan: Plan, resident: Resident, say: Callable[[str], None]) -> None:
    """Run the chain on a few pixels with every sampler. From the cache it takes a second, compiling half a minute."""
    doing = "loading" if compiled_kernels() >= ENOUGH_KERNELS else "compiling"
    with _one_compiler():
        for method in METHODS:
            say(f"{doing} kernels ({method})")
            _one_pixel_block(plan, resident, method)


def _one_pixel_block(plan: Plan, resident: Resident, method: str) -> None:
    layout = plan.layout
    rank = layout.renderers()[0]
    tiny = Region(panel=layout.region(rank).panel, rect=TINY)
    small = replace(plan, layout=replace(layout, regions=(tiny, *layout.regions[1:])))
    clock = ManualClock()
    samplers = make_samplers(small, method, tiny, clock)
    worker = Worker(small, resident, rank, clock, samplers, 0)
    panel = PanelCompositor(plan, tiny.panel, reconstruction="cpu")  # OpenGL must not be opened before ranks fork
    event = replace(first_event(plan, 0.0), sampler=method)
    panel.follow(event)
    packet = worker.step(event)
    if packet is not None:
        batch = decode(packet)
        panel.insert(batch)
        worker.forget(batch)
    for number in range(2):  # something moved, nothing moved
        panel.refresh(event, 0.1 * number)
        worker.step(event)
    tiling = worker.tiling()
    if tiling is not None:
        panel.take_tiling(decode_tiling(tiling))
    panel.buffer.oldest_sample(0.0)
    panel.surveys(0.0)


@contextmanager
def _one_compiler() -> Iterator[None]:
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
