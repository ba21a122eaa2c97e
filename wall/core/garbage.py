"""When Python collects garbage: rarely while a command starts, as usual once it runs.

Modules, models of configurations and kernels are hundreds of thousands of objects that stay. Python looks through them
again and again while they are made: a seventh of a start.
"""

from __future__ import annotations

import gc

USUAL = gc.get_threshold()
OBJECTS_A_COLLECTION = 100_000  # Python's own are 700


def collect_rarely() -> None:
    """Of a process that starts, or compiles."""
    gc.set_threshold(OBJECTS_A_COLLECTION, *USUAL[1:])


def collect_as_usual() -> None:
    """From now on."""
    gc.set_threshold(*USUAL)


def started() -> None:
    """After `collect_rarely`: what is there stays, no collection looks at it again, and the rest is collected as usual.

    Processes that are forked after this share it: no collection writes to it. Does nothing in a process of others, such
    as a script that starts a wall.
    """
    if gc.get_threshold()[0] == OBJECTS_A_COLLECTION:
        gc.freeze()
        collect_as_usual()
