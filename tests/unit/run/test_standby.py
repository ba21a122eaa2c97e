"""What a head writes for the next one is whole, whenever it dies."""

from __future__ import annotations

from wall.run.standby import MOST_BYTES, SharedState


def test_the_newest_bytes_that_were_written_to_their_end_are_read() -> None:
    state = SharedState()
    assert state.read() is None
    for text in (b"first", b"second", b"third"):
        assert state.write(text)
        assert state.read() == text
    place = state._memory.find(b"third")
    state._memory[place : place + 2] = b"fo"  # killed while it wrote the fourth there
    assert state.read() == b"second"
    assert state.write(b"fifth"), "the next head goes on writing"
    assert state.read() == b"fifth"
    assert not state.write(bytes(MOST_BYTES + 1))
    assert state.read() == b"fifth"
