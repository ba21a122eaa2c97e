"""`wall run`: make the ranks, be one of them, end cleanly.

The same few lines run under mpirun and on a laptop; only where the ranks come from differs (bootstrap.py).
"""

from __future__ import annotations

import json
import socket
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from wall.config.loading import Loaded
from wall.core.errors import ConfigError
from wall.core.garbage import started
from wall.core.mpi import mpi_rank, under_mpi
from wall.core.network import is_loopback, why_taken
from wall.display.x_server import check_displays
from wall.roles.membership import head_lost_s
from wall.roles.plan import (
    HEAD,
    Layout,
    Plan,
    check_files,
    make_layout,
    make_plan,
    reconstructed_at_renderers,
    window_panels,
)
from wall.run.bootstrap import Bootstrap
from wall.run.bootstrap_local import LocalBootstrap
from wall.run.bootstrap_threads import ThreadBootstrap
from wall.run.control_file import check_free, claimed
from wall.run.cores import own_cores, quota, share_of_cores, usable_cores
from wall.run.endings import held_back
from wall.run.first_look import dark_views
from wall.run.head import Options as Options
from wall.run.head import Outcome, lead
from wall.run.host_memory import check_started
from wall.run.hosts import Renumbered, assign
from wall.run.ranks import serve
from wall.run.recording import begin_recording, check_unused
from wall.run.same_files import check_same
from wall.run.sinks import check_page, import_page
from wall.run.standby import LaunchedStand, Stand
from wall.run.succession import Preparer
from wall.run.turns import Turns
from wall.run.usage import give_memory_back
from wall.run.warm_up import warm_up
from wall.tracing.tracer_scene import TracerScene, make_tracer_scene

if TYPE_CHECKING:
    from wall.run.bootstrap_mpi import MpiBootstrap


def run(loaded: Loaded, options: Options, say: Callable[[str], None], opened: Callable[[str], None]) -> Outcome | None:
    """Run a wall. Gives the outcome at rank 0, None at the others.

    `say` shows a line of progress; `opened` is called with the page's address. Raises ConfigError, RunError.
    """
    layout = make_layout(loaded)
    check_files(layout)
    if mpi_rank() == HEAD:
        check_page(layout, headless=options.headless)
        check_bind(layout)
    check_folder(options.out)
    with claimed(options.out) if mpi_rank() == HEAD else nullcontext():
        if options.record is not None and mpi_rank() == HEAD:
            check_unused(options.record)
        return _run_mpi(layout, options, say, opened) if under_mpi() else _run_local(layout, options, say, opened)


def check_bind(layout: Layout) -> None:
    """Refuse an address that is not the head's machine's, before anything is loaded. Raises ConfigError."""
    transport = layout.config.transport
    if transport.kind != "loopback" and (why := why_taken(transport.bind, 0)):
        accepted = "an address of this machine, or 0.0.0.0: all of them"
        raise layout.loaded.error(("transport", "bind"), f"cannot listen there ({why})", accepted)


def check_folder(folder: Path) -> None:
    """Make the folder of results, and refuse one that cannot be written or is in use, before anything is rendered."""
    if mpi_rank() == HEAD:
        check_free(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigError(f"--out {folder}: {error.strerror}; wanted a folder that can be written") from error


def _run_local(layout: Layout, options: Options, say: Callable[[str], None], opened: Callable[[str], None]) -> Outcome:
    if not options.headless:
        check_displays(window_panels(layout, range(layout.size)))
    machines = [""] * layout.size
    layout = reconstructed_at_renderers(layout, machines)
    ranks = range(layout.size)
    cores = share_of_cores(layout.size - 1, [own_cores()] * layout.size, head=HEAD, limit=quota())
    plan, tracer_scene = prepare(layout, say, headless=options.headless, cores=cores, ranks=ranks)
    if options.record is not None:
        begin_recording(options.record, plan)

    turns = Turns() if usable_cores() <= 1.0 and layout.config.transport.kind != "loopback" else None

    def main(bootstrap: Bootstrap) -> None:
        preparer = Preparer(plan, machines)
        serve(
            plan, tracer_scene, bootstrap, preparer,
            headless=options.headless, out=options.out, record=options.record, turns=turns,
        )  # fmt: skip

    transport = layout.config.transport
    if stands_by(plan, options, say):
        say(f"starting {layout.size} processes")
        return Stand(
            layout.size, main, lambda head: lead(plan, head, Preparer(plan, machines), options, say, opened),
            encrypted=transport.encrypted, patience_s=head_lost_s(transport),
        ).run()  # fmt: skip
    bootstrap: Bootstrap
    with ExitStack() as closing:
        if transport.kind == "loopback":
            say(f"starting {layout.size} threads")
            bootstrap = ThreadBootstrap.start(layout.size, main)
            closing.callback(bootstrap.finish, told=False)
        else:
            say(f"starting {layout.size} processes")
            again, encrypted = transport.restarts > 0, transport.encrypted
            with held_back():
                bootstrap = LocalBootstrap.start(layout.size, main, again=again, encrypted=encrypted)
                closing.callback(bootstrap.finish, told=False)  # who is there then was not told by the head
        return lead(plan, bootstrap, Preparer(plan, machines), options, say, opened)


def _run_mpi(
    layout: Layout, options: Options, say: Callable[[str], None], opened: Callable[[str], None]
) -> Outcome | None:
    from wall.run.bootstrap_mpi import MpiBootstrap

    launched = MpiBootstrap()
    launched.finish()  # however it ends: MPI would wait for the others for ever
    try:
        return _run_launched(launched, layout, options, say, opened)
    except BaseException:
        launched.refuse()
        raise


def _run_launched(
    launched: MpiBootstrap, layout: Layout, options: Options, say: Callable[[str], None], opened: Callable[[str], None]
) -> Outcome | None:
    machines = launched.allgather(socket.gethostname())
    bound = [json.loads(text) for text in launched.allgather(json.dumps(own_cores()))]
    for note in check_same(launched, layout, machines):
        if launched.rank == HEAD:
            say(f"note: {note}")
    check_size(layout, launched.size, tell=launched.rank == HEAD)
    check_reached(layout, machines, tell=launched.rank == HEAD)
    if layout.config.transport.encrypted:
        launched.make_keys()
    rank_of, bootstrap = _placed(layout, launched, machines)
    by_rank = [machine for _, machine in sorted(zip(rank_of, machines, strict=True))]
    layout = reconstructed_at_renderers(layout, by_rank)
    if layout.config.transport.kind == "loopback":
        raise layout.loaded.error(("transport", "kind"), "MPI ranks are processes; loopback stays inside one", "zmq")
    if not options.headless:
        check_displays(window_panels(layout, (bootstrap.rank,)))
    cores = _cores_of(bootstrap.rank, by_rank, dict(zip(rank_of, bound, strict=True)))
    plan, tracer_scene = prepare(
        layout, say if bootstrap.rank == HEAD else lambda line: None, headless=options.headless,
        cores=cores, ranks=_on(socket.gethostname(), by_rank),
    )  # fmt: skip
    if options.record is not None and bootstrap.rank == HEAD:
        begin_recording(options.record, plan)
    preparer = Preparer(plan, by_rank)
    if bootstrap.rank != HEAD:
        with launched.failing_alone():
            serve(
                plan, tracer_scene, bootstrap, preparer,
                headless=options.headless, out=options.out, record=options.record,
            )  # fmt: skip
        return None
    if not stands_by(plan, options, say):
        return lead(plan, bootstrap, preparer, options, say, opened)
    return LaunchedStand(
        bootstrap, lambda head: lead(plan, head, preparer, options, say, opened),
        patience_s=head_lost_s(layout.config.transport),
    ).run()  # fmt: skip


def stands_by(plan: Plan, options: Options, say: Callable[[str], None]) -> bool:
    """Whether this process is to fork a head, and another one where that dies; ready for it then, else says why not."""
    if not plan.layout.config.transport.standby:
        return False
    if kept := options.record or options.images:
        say(f"note: transport.standby: no head takes another's place, which could not go on with {kept}")
        return False
    if not options.headless:
        import_page(plan)
    return True


def _placed(layout: Layout, launched: Bootstrap, machines: Sequence[str]) -> tuple[tuple[int, ...], Bootstrap]:
    """The wall's rank of every launched process, by their machines; one of them tells why that cannot be."""
    try:
        rank_of = assign(layout.graph.hosts, machines, config=layout.loaded.name)
        return rank_of, Renumbered(launched, rank_of)
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
        + (f" + {extra} remote compositor{'s' * (extra > 1)}" if extra else "")
        + f" + {len(layout.regions)} renderer{'s' * (len(layout.regions) > 1)} "
        f"(mpirun --with-ft ulfm -x PATH -n {layout.size} wall run ...)"
    )


def check_reached(layout: Layout, machines: Sequence[str], *, tell: bool = True) -> None:
    """Refuse a launch on several machines whose head none of the others could reach; one rank tells why."""
    bind, others = layout.config.transport.bind, sorted(set(machines[1:]) - {machines[0]})
    if not (others and is_loopback(bind)):
        return
    if not tell:
        raise SystemExit(2)
    raise layout.loaded.error(
        ("transport", "bind"),
        f"only {machines[0]} can reach it, and ranks were launched on {', '.join(others[:4])} too",
        "0.0.0.0, or the head's address in the network that these machines share",
    )


def _cores_of(rank: int, by_rank: Sequence[str], bound: Mapping[int, Sequence[int]]) -> float:
    """The cores of this process; `bound`: numbers of those that each rank may run on, as its launcher says."""
    beside = _on(by_rank[rank], by_rank)
    head = beside.index(HEAD) if HEAD in beside else None
    return share_of_cores(beside.index(rank), [bound[other] for other in beside], head=head, limit=quota())


def _on(machine: str, by_rank: Sequence[str]) -> list[int]:
    """The ranks that are on a machine."""
    return [rank for rank, host in enumerate(by_rank) if host == machine]


def prepare(
    layout: Layout, say: Callable[[str], None], *, headless: bool, cores: float = 1.0, ranks: Sequence[int] = ()
) -> tuple[Plan, TracerScene]:
    """Load the scene of a layout, and the kernels. Raises ConfigError.

    `cores`: that this process may keep busy, beside the others of the run.
    `ranks`: those that are to run on this machine, which are refused if they need more memory than it has left.
    """
    say("loading the scene")
    plan = replace(make_plan(layout), cores=cores)
    for note in (*layout.notes, *plan.scene.notes):
        say(f"note: {note}")
    if ranks:
        check_started(plan, ranks, forked=not under_mpi(), host=socket.gethostname())
    say("building the ray tracing trees")
    tracer_scene = make_tracer_scene(plan.scene)
    warm_up(plan, tracer_scene, say, headless=headless)
    for note in dark_views(plan, tracer_scene):
        say(f"note: {note}")
    started()
    give_memory_back()
    return plan, tracer_scene
