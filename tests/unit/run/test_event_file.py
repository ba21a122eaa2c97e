"""Files of events: what was written is read, in order; damage, ends and other turns are told."""

from __future__ import annotations

import errno

import numpy as np
import pytest

from wall.core.data import SAMPLE, Batch, Rect
from wall.core.errors import RunError
from wall.run.event_file import EndOfFileError, EventFile, EventReader, checksum


def batch(**changes):
    samples = np.zeros(3, SAMPLE)
    samples["xy"] = [(1, 2), (3, 4), (5, 6)]
    values = {
        "view": 0, "panel": 0, "rect": Rect(x=0, y=0, width=8, height=8), "rank": 1, "sequence": 2, "camera_event": 3,
        "scene_event": 4, "base_time": 0.5, "samples": samples,
    }  # fmt: skip
    return Batch(**(values | changes))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "rank-1.events"


def written(path):
    events = EventFile(path)
    events.cores(0.4)
    events.message(b"hello")
    events.time(0.1)
    events.message(b"")
    events.no_more()
    events.answer(True)
    events.answer(False)
    events.dropped([b"a", b"bc"])
    events.dropped([])
    events.batch(0, None)
    events.batch(1, b"packet")
    events.batch(2, batch())
    events.time(1e300)
    return events


def test_entries_are_read_as_they_were_written(path):
    written(path).close()
    events = EventReader(path)
    assert events.cores() == 0.4
    assert events.message() == b"hello"
    assert events.time() == 0.1
    assert events.message() == b""
    assert events.message() is None
    assert (events.answer(), events.answer()) == (True, False)
    assert (events.dropped(), events.dropped()) == ([b"a", b"bc"], [])
    assert events.batch() == (0, 0)
    assert events.batch() == (1, checksum(b"packet"))
    assert events.batch() == (2, checksum(batch()))
    assert (events.time(), events.seconds, events.batches) == (1e300, (0.1, 1e300), 3)
    with pytest.raises(EndOfFileError):
        events.time()


def read_on(reader):
    for read in (*[reader.answer] * 2, *[reader.dropped] * 2, *[reader.batch] * 3, reader.time, *[reader.message] * 2):
        read()


def test_a_file_that_was_cut_is_read_up_to_there(path, monkeypatch):
    monkeypatch.setattr("wall.run.event_file.FLUSH_S", 0.0)
    events = written(path)
    events.no_more()  # a flush; then the process is killed
    cut = path.read_bytes()
    assert len(cut) > 40
    path.write_bytes(cut[:-4])
    reader, taken = EventReader(path), []
    for read in (reader.cores, reader.message, reader.time, reader.message, reader.message):
        taken.append(read())
    with pytest.raises(EndOfFileError):
        read_on(reader)
    assert taken == [0.4, b"hello", 0.1, b"", None]


def test_another_turn_than_in_the_run_is_told(path):
    written(path).close()
    events = EventReader(path)
    assert events.cores() == 0.4
    with pytest.raises(RunError, match="went on with a message, this replay wants a reading of the clock"):
        events.time()


@pytest.mark.parametrize("data", [b"no such stream", b"\x78\x01" + b"\xff" * 40])
def test_what_is_no_file_of_events_is_refused(path, data):
    path.write_bytes(data)
    with pytest.raises(RunError, match="not a file of events, or damaged"):
        EventReader(path).message()


def test_a_missing_file_is_named(path):
    with pytest.raises(RunError, match=r"rank-1\.events: cannot be read \(No such file"):
        EventReader(path).message()
    with pytest.raises(RunError, match=r"events cannot be recorded to .*nowhere/x: No such file"):
        EventFile(path.parent / "nowhere" / "x")


def test_a_full_disk_ends_the_recording_and_says_so(path):
    events = written(path)

    class Full:
        closed = False

        def write(self, data):
            raise OSError(errno.ENOSPC, "No space left on device")

        def close(self):
            self.closed = True

    events._file.close()
    events._file = Full()
    events._write(2)
    events.close()
    assert events.note == f"{path}: no more events are recorded: No space left on device"


@pytest.mark.parametrize(
    "changes", [{"sequence": 9}, {"base_time": 0.25}, {"camera_event": 9}, {"scene_time": 1.0}, {"samples": "moved"}]
)
def test_checksums_tell_batches_apart(changes):
    if "samples" in changes:
        samples = batch().samples.copy()
        samples["xy"][0, 0] = np.nextafter(np.float32(1), np.float32(2))
        changes = {"samples": samples}
    assert checksum(batch(**changes)) != checksum(batch())
    assert checksum(batch()) == checksum(batch())
