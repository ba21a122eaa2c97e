"""What `wall check` says of memory: what a wall needs on one machine and in its largest rank, against what is left."""

from __future__ import annotations

import socket
from collections.abc import Iterator

from wall.core.system import available_bytes
from wall.roles.memory import memory_on_host
from wall.roles.plan import Plan, on_one_machine
from wall.run.host_memory import GB, MB, SURELY, check_memory, parts_of, ranks_here, too_much
from wall.run.usage import memory, peak_of_children, usage


def memory_lines(plan: Plan) -> Iterator[str]:
    """A line of what the wall needs, and a note where that is too much for this machine alone.

    Raises ConfigError where a single rank that may come here needs more than is left.
    """
    loading = max(usage().peak_memory, memory() + peak_of_children())  # one that read models and data for this one
    host, left = socket.gethostname(), available_bytes()
    left = None if left is None else left + memory()  # what this process has loaded is counted in what ranks need
    one = on_one_machine(plan)
    ranks = range(plan.layout.size)
    needed = memory_on_host(one, ranks, forked=True)
    largest = max(needed.ranks, key=lambda rank: rank.own)
    alone = memory_on_host(one, [largest.rank], forked=False)
    parts = ", ".join(f"{name} {size / MB:.0f}" for name, size in parts_of(needed).items() if size >= MB)
    here = "" if left is None else f"; {left / GB:.1f} GB are left here"
    yield (
        f"memory: {needed.total / GB:.2f} GB if all {plan.layout.size} ranks run on one machine (MB: {parts}); by "
        f"itself rank {largest.rank} needs the most, {alone.total / GB:.2f} GB{here}"
    )
    if loading > alone.total:
        yield f"memory: loading the scene took {loading / GB:.2f} GB for a while, for each process that loads it"
    for rank in ranks_here(plan.layout, host):
        check_memory(one, [rank], forked=False, available=left, host="this machine")
    if left is not None and needed.total > left:
        refused = "; wall run refuses to start them all here" if needed.total > SURELY * left else ""
        yield f"note: {too_much(needed, left, 'one machine')}{refused}"
