"""Of a process that starts, garbage is collected rarely; of one that has started, only what is newer."""

from __future__ import annotations

import gc
import weakref

from wall.core.garbage import USUAL, collect_as_usual, collect_rarely, started


class Ring:
    """Garbage that reference counts do not see."""

    def __init__(self) -> None:
        self.itself = self


def test_what_is_there_at_the_start_is_not_looked_at_again_and_what_is_newer_is() -> None:
    collect_rarely()
    try:
        assert gc.get_threshold()[0] > USUAL[0]
        old = Ring()
        started()
        assert gc.get_threshold() == USUAL
        new = Ring()
        is_old, is_new = weakref.ref(old), weakref.ref(new)
        del old, new
        gc.collect()
        assert is_old() is not None
        assert is_new() is None
    finally:
        gc.unfreeze()
        collect_as_usual()


def test_in_a_process_of_others_nothing_is_kept() -> None:
    before = gc.get_freeze_count()
    started()
    assert gc.get_freeze_count() == before
