"""`wall run`: make the ranks, join the stages, end cleanly.

The same few lines run under mpirun and on a laptop; only where the ranks come from differs (bootstrap.py).
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from wall.config.loading import Loaded
from wall.core.errors import ConfigError
from wall.display.browser import Browser
from wall.display.window import WindowSink
from wall.display.x_server import check_displays
from wall.roles.edges import targets_of
from wall.roles.head import Head
from wall.roles.plan import HEAD, Layout, Plan, check_files, make_layout, make_plan
from wall.roles.remote_compositor import RemoteCompositor
from wall.roles.renderer import Renderer
from wall.run.bootstrap import Bootstrap, under_mpi
from wall.run.bootstrap_local import LocalBootstrap
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.clock import HeadClock
from wall.run.control import Control
from wall.run.hosts import Renumbered, assign
from wall.run.sinks import distinct, make_sinks, notes_of, window_panels
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene
from wall.transport.base import Hub, Link
from wall.transport.factory import connect, open_hub

RENDERER_NICE = 5  # renderers share this machine's cores with the head: showing comes before tracing


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What the command line adds to a configuration."""

    out: Path
    seconds: float | None = None  # None: until stopped
    headless: bool = False  # no browser page
    until_complete: bool = False  # stop when the still picture has all its samples
    still: bool = False  # begin paused


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    summary: dict[str, Any]
    failed: str  # why the run failed, "" if it did not


def run(loaded: Loaded, options: Options, say: Callable[[str], None], opened: Callable[[str], None]) -> Outcome | None:
    """Run a wall. Gives the outcome at rank 0, None at the others.

    `say` shows a line of progress; `opened` is called with the page's address. Raises ConfigError, RunError.
    """
    layout = make_layout(loaded)
    check_files(layout)
    check_folder(options.out)
    return _run_mpi(layout, options, say, opened) if under_mpi() else _run_local(layout, options, say, opened)


def check_folder(folder: Path) -> None:
    """Make the folder of results, and refuse one that cannot be written, before anything is rendered."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigError(f"--out {folder}: {error.strerror}; wanted a folder that can be written") from error


def _run_local(layout: Layout, options: Options, say: Callable[[str], None], opened: Callable[[str], None]) -> Outcome:
    if not options.headless:
        check_displays(window_panels(layout, range(layout.size)))
    plan, tracer_scene = _prepare(layout, say)

    def main(bootstrap: Bootstrap) -> None:
        serve(plan, tracer_scene, bootstrap, headless=options.headless)

    bootstrap: Bootstrap
    if layout.config.transport.kind == "loopback":
        say(f"starting {layout.size} threads")
        bootstrap = ThreadBootstrap.start(layout.size, main)
    else:
        say(f"starting {layout.size} processes")
        bootstrap = LocalBootstrap.start(layout.size, main)
    try:
        return lead(plan, tracer_scene, bootstrap, options, say, opened)
    finally:
        bootstrap.finish()


def _run_mpi(
    layout: Layout, options: Options, say: Callable[[str], None], opened: Callable[[str], None]
) -> Outcome | None:
    from wall.run.bootstrap_mpi import MpiBootstrap

    launched = MpiBootstrap()
    check_size(layout, launched.size, tell=launched.rank == HEAD)
    bootstrap = _placed(layout, launched)
    if layout.config.transport.kind == "loopback":
        raise layout.loaded.error(("transport", "kind"), "MPI ranks are processes; loopback stays inside one", "zmq")
    if not options.headless:
        check_displays(window_panels(layout, (bootstrap.rank,)))
    plan, tracer_scene = _prepare(layout, say if bootstrap.rank == HEAD else lambda line: None)
    if bootstrap.rank != HEAD:
        serve(plan, tracer_scene, bootstrap, headless=options.headless)
        bootstrap.finish()
        return None
    return lead(plan, tracer_scene, bootstrap, options, say, opened)


def _placed(layout: Layout, launched: Bootstrap) -> Bootstrap:
    """The launched processes under the ranks that suit their machines; one of them tells why that cannot be."""
    machines = launched.allgather(socket.gethostname())
    try:
        return Renumbered(launched, assign(layout.graph.hosts, machines, config=layout.loaded.name))
    except ConfigError:
        if launched.rank == HEAD:
            raise
        raise SystemExit(2) from None


def check_size(layout: Layout, size: int, *, tell: bool = True) -> None:
    """Refuse a launch with more or fewer ranks than the configuration places; one rank tells why."""
    if size == layout.size:
        return
    if not tell:
        raise SystemExit(2)
    extra = layout.graph.compositors - 1
    raise ConfigError(
        f"{layout.loaded.path}: {size} ranks were launched, the configuration needs {layout.size}: 1 head"
        + (f" + {extra} further compositor{'s' * (extra > 1)}" if extra else "")
        + f" + {len(layout.regions)} renderer{'s' * (len(layout.regions) > 1)} (mpirun -n {layout.size} wall run ...)"
    )


def _prepare(layout: Layout, say: Callable[[str], None]) -> tuple[Plan, TracerScene]:
    say("loading the scene")
    plan = make_plan(layout)
    for note in plan.scene.notes:
        say(f"note: {note}")
    say("building the ray tracing trees")
    tracer_scene = make_tracer_scene(plan.scene)
    warm_up(plan, tracer_scene, say)
    return plan, tracer_scene


def serve(plan: Plan, tracer_scene: TracerScene, bootstrap: Bootstrap, *, headless: bool) -> None:
    """Be a rank other than the head, until it says stop."""
    layout, rank = plan.layout, bootstrap.rank
    hub = _hub(plan) if layout.role(rank) == "compositor" else None
    about = {"data": hub.endpoint if hub else "", "machine": machine_id()}
    endpoints = [json.loads(text) for text in bootstrap.allgather(json.dumps(about))]
    link = connect(endpoints[HEAD]["control"], rank=rank)
    control = Control(link, plan, rank, same_clock=endpoints[HEAD]["machine"] == machine_id())
    if hub is not None:
        _compose(plan, rank, hub, control, [about["data"] for about in endpoints], headless=headless)
        _close(link)
        return
    outbox = connect(endpoints[layout.target_of(rank)]["data"], rank=rank)
    renderer = Renderer(plan, tracer_scene, rank, control, outbox)
    if isinstance(bootstrap, LocalBootstrap):
        os.nice(RENDERER_NICE)
    try:
        renderer.run()
    finally:
        renderer.close()
        _close(outbox, link)


def _compose(plan: Plan, rank: int, hub: Hub, control: Control, endpoints: list[str], *, headless: bool) -> None:
    """Be a compositor beside the head."""
    links = _links(plan, rank, endpoints, {HEAD})
    sinks, _ = make_sinks(plan, rank, Path(), headless=headless)
    for note in notes_of(sinks):
        print(f"rank {rank}: note: {note}", file=sys.stderr, flush=True)
    try:
        RemoteCompositor(plan, rank, hub, control, links, sinks).run()
    finally:
        _close(*distinct(sinks), *links.values(), hub)


def _links(plan: Plan, rank: int, endpoints: list[str], more: set[int]) -> dict[int, Link]:
    """To the other compositors that need framelets of this one, and to some more."""
    targets = {target for targets in targets_of(plan.layout.graph, rank).values() for target in targets}
    return {target: connect(endpoints[target], rank=rank) for target in sorted(targets | more)}


def machine_id() -> str:
    """Names this machine since it was started: processes that agree share one monotonic clock."""
    return Path("/proc/sys/kernel/random/boot_id").read_text().strip()


def _hub(plan: Plan) -> Hub:
    transport = plan.layout.config.transport
    return open_hub(transport.kind, transport.bind, credit_bytes=transport.credit_bytes)


def _close(*things: Any) -> None:
    for thing in things:
        thing.close()


def lead(
    plan: Plan,
    tracer_scene: TracerScene,
    bootstrap: Bootstrap,
    options: Options,
    say: Callable[[str], None],
    opened: Callable[[str], None],
) -> Outcome:
    """Be the head: serve the page, run the wall, write what is asked for at the end."""
    hub = _hub(plan)
    control_hub = _hub(plan)
    sinks, browser = make_sinks(plan, HEAD, options.out, headless=options.headless)
    for note in notes_of(sinks):
        say(f"note: {note}")
    head: Head | None = None
    links: dict[int, Link] = {}
    try:
        about = {"data": hub.endpoint, "control": control_hub.endpoint, "machine": machine_id()}
        endpoints = [json.loads(text)["data"] for text in bootstrap.allgather(json.dumps(about))]
        links = _links(plan, HEAD, endpoints, set())
        hands = [sink.commands for sink in distinct(sinks) if isinstance(sink, Browser | WindowSink)]
        head = Head(plan, bootstrap, hub, control_hub, HeadClock(), links, sinks, hands, still=options.still)
        with _signals(head):
            opened(browser.address if browser else "")
            head.run(seconds=options.seconds, until_complete=options.until_complete)
    finally:
        if head is not None:
            head.finish()
        else:
            _close(*distinct(sinks))
        bootstrap.finish(1 if head is None or head.lost else 0)
        _close(*links.values(), hub, control_hub)
    summary = head.summary()
    write_json(options.out / "summary.json", summary)
    failed = "; ".join(f"rank {rank} {how}" for rank, how in sorted(head.lost.items()))
    return Outcome(summary=summary, failed=failed)


def write_json(path: Path, value: Any) -> None:
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")
    os.replace(temporary, path)


class _signals:  # noqa: N801
    """While inside, Ctrl-C and SIGTERM end the run in order instead of tearing it apart."""

    def __init__(self, head: Head) -> None:
        self._head = head

    def __enter__(self) -> None:
        self._before = {s: signal.signal(s, self._stop) for s in (signal.SIGINT, signal.SIGTERM)}

    def __exit__(self, *_: object) -> None:
        for s, handler in self._before.items():
            signal.signal(s, handler)

    def _stop(self, number: int, frame: FrameType | None) -> None:
        self._head.stopping = "interrupted" if number == signal.SIGINT else "terminated"
