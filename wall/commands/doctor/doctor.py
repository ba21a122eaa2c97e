"""All checks of one machine, or, under mpirun, of all hosts, and their clocks."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

from wall.commands.doctor import machine, network
from wall.commands.doctor.finding import Check, Finding, State, findings
from wall.config.loading import Loaded
from wall.core.mpi import under_mpi
from wall.roles.plan import Layout, check_files, make_layout
from wall.run.same_files import Gathers
from wall.transport.base import MAX_MESSAGE_BYTES

MOST_OFFSET_S = 1.0  # of clocks: logs of hosts are then still in order for a reader; runs have a clock of their own
BYTES_A_PIXEL = 16  # of what a rank hands on: colour, depth and more


def checks(layout: Layout | None, out: Path) -> Iterator[Check]:
    """Every check of this machine; `layout`: of a configuration, None: none was named."""
    ranks = layout.size if layout is not None else 0
    yield Check("packages", machine.packages)
    yield Check("cores", partial(machine.cores, ranks))
    yield Check("open files", partial(machine.open_files, ranks))
    yield Check("shared memory", partial(machine.shared_memory, _shared_bytes(layout) if layout is not None else 0))
    yield Check("disk", partial(machine.disk, out), mend="another folder in output.directory, or --out of wall run")
    if not under_mpi():  # which has found its ranks, and would not start others
        hosts = layout is not None and bool(layout.graph.hosts)
        yield Check("mpi", partial(machine.mpi, needed=hosts), limit_s=machine.MPI_S + 5.0)
    wishes = () if layout is None else tuple(map(layout.config.reconstruction_of, range(len(layout.config.views))))
    yield Check("gpu", partial(machine.gpu, needed="gpu" in wishes), limit_s=machine.GPU_S + 5.0)
    if layout is not None:
        yield Check(
            "models", partial(_files, layout), limit_s=60.0, mend="copy the file to this host, to the same path"
        )
        yield Check("ports", partial(network.ports, layout))
        mend = "see docs/guide/cluster.md: Ports and the page from afar"
        yield Check("page", partial(network.page, layout), mend=mend)
        mend = "start the X server, name the display in the wall's panels, or use --headless"
        yield Check("displays", partial(network.displays, layout, socket.gethostname()), mend=mend)


def _files(layout: Layout) -> Iterator[Finding]:
    check_files(layout)
    yield Finding(name="models", state="ok", found="all files that the configuration names are here")


def _shared_bytes(layout: Layout) -> int:
    """Bytes of shared memory that images between ranks of one machine take at most: two of them for each panel."""
    sizes = [panel.pixels[0] * panel.pixels[1] * BYTES_A_PIXEL for panel in layout.wall.panels]
    return sum(2 * min(size, MAX_MESSAGE_BYTES) for size in sizes)


def examine(loaded: Loaded | None, out: Path) -> Iterator[tuple[str, Sequence[Finding]]]:
    """By host: what was found. Under mpirun every host is looked at, and rank 0 gets all, the others nothing."""
    layout = make_layout(loaded) if loaded is not None else None
    found = findings(checks(layout, out))
    if not under_mpi():
        yield socket.gethostname(), list(found)
        return
    from wall.run.bootstrap_mpi import MpiBootstrap

    ranks = MpiBootstrap()
    ranks.finish()
    hosts = ranks.allgather(socket.gethostname())
    first = hosts.index(hosts[ranks.rank]) == ranks.rank  # one rank looks at each host
    texts = ranks.allgather(json.dumps([asdict(each) for each in found] if first else []))
    offsets = clock_offsets(ranks)
    if ranks.rank == 0:
        for rank, host in enumerate(hosts):
            if hosts.index(host) == rank:
                told = [Finding(**values) for values in json.loads(texts[rank])]
                yield host, [*told, _clock(*offsets[rank])]


def clock_offsets(ranks: Gathers) -> list[tuple[float, float]]:
    """Of every rank: how far its clock is ahead of rank 0's, and how well that is known; seconds.

    All read their clocks between two exchanges: so they do it within the time that passes from the end of the first to
    that of the second.
    """
    ranks.allgather("")  # all are here
    began = time.monotonic()
    read = ranks.allgather(repr(time.time()))
    within_s = max(float(text) for text in ranks.allgather(repr(time.monotonic() - began)))
    return [(float(text) - float(read[0]), within_s) for text in read]


def _clock(offset_s: float, within_s: float) -> Finding:
    """What a host's clock is like."""
    state: State = "ok" if abs(offset_s) - within_s <= MOST_OFFSET_S else "warning"
    found = f"{offset_s:+.3f} s against rank 0's, known within {within_s:.3f} s"
    return Finding(name="clock", state=state, found=found, mend="let chrony or systemd-timesyncd set it")
