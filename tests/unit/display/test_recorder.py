"""The recorder's rate, its files, and what it does when the disk is too slow."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from PIL import Image

from wall.core.errors import RunError
from wall.display.png import whole_wall
from wall.display.recorder import QUEUE_IMAGES, Recorder


def index(folder):
    return [json.loads(line) for line in (folder / "index.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("hz", [10, 30, 60])
def test_at_most_hz_images_a_second_are_kept(hz, tmp_path, image, status):
    recorder = Recorder(tmp_path, hz=float(hz))
    for k in range(61):  # one second at 60 Hz
        recorder.show(image(k + 1, time=5.0 + k / 60), status)
    recorder.close()
    times = [line["time"] for line in index(tmp_path)]
    turns = [5.0 + k / hz for k in range(hz + 1)]
    # the test is faster than any disk: a turn is either written or counted as dropped
    assert len(times) + recorder.dropped().get("recorder_behind", 0) == len(turns)
    assert all(min(abs(time - turn) for turn in turns) < 1e-9 for time in times)


def test_a_stall_does_not_make_it_catch_up(tmp_path, image, status):
    recorder = Recorder(tmp_path, hz=10.0)
    for version, time in enumerate([0.0, 3.0, 3.05, 3.1], start=1):
        recorder.show(image(version, time=time), status)
    recorder.close()
    assert [line["time"] for line in index(tmp_path)] == [0.0, 3.0, 3.1]


def test_a_recording_is_resumed_after_what_was_written_whole(tmp_path, image, status):
    for part, resume in enumerate((False, True)):
        recorder = Recorder(tmp_path, hz=10.0, resume=resume)
        recorder.show(image(1, time=float(part)), status)
        recorder.close()
        with (tmp_path / "index.jsonl").open("a") as file:
            file.write('{"file": "000')  # as after SIGKILL
        (tmp_path / "000007.jpg").write_bytes(b"")
    Recorder(tmp_path, hz=10.0, resume=True).close()
    assert [(line["file"], line["time"]) for line in index(tmp_path)] == [("000000.jpg", 0.0), ("000001.jpg", 1.0)]
    assert sorted(path.name for path in tmp_path.glob("*.jpg")) == ["000000.jpg", "000001.jpg"]


def test_unchanged_image_is_not_written_again(tmp_path, image, status):
    recorder = Recorder(tmp_path, hz=10.0)
    for time, version in [(0.0, 1), (1.0, 1), (2.0, 2)]:
        recorder.show(image(version, time=time), status)
    recorder.close()
    assert [line["time"] for line in index(tmp_path)] == [0.0, 2.0]


def test_index_and_images_belong_together(tmp_path, image, status):
    recorder = Recorder(tmp_path / "recording", hz=100.0)
    shown = [image(k, time=float(k), value=60 * k, events=(k, 2 * k)) for k in (1, 2, 3)]
    for one in shown:
        recorder.show(one, status)
    recorder.close()
    lines = index(tmp_path / "recording")
    assert [line["file"] for line in lines] == ["000000.jpg", "000001.jpg", "000002.jpg"]
    assert [(line["camera_event"], line["scene_event"]) for line in lines] == [(1, 2), (2, 4), (3, 6)]
    assert lines[0]["latency_ms"] == [20.0, 30.0, 40.0]
    for line, one in zip(lines, shown, strict=True):
        kept = np.array(Image.open(tmp_path / "recording" / line["file"]))
        assert np.array_equal(kept.shape, whole_wall(one).shape)
        centre = one.panels[0].screen[0] + 8
        # flat colour: JPEG loses at most a rounding of YCbCr in the block that lies wholly inside the panel
        assert abs(int(kept[4, centre, 0]) - int(one.panels[0].rgb[4, 8, 0])) <= 6


def test_slow_disk_drops_images_and_counts_them(tmp_path, image, status):
    recorder = Recorder(tmp_path, hz=1000.0)
    pipe = tmp_path / "000000.jpg"  # a disk that hangs: nobody reads this pipe yet
    os.mkfifo(pipe)
    shown = QUEUE_IMAGES + 12
    for k in range(shown):
        recorder.show(image(k + 1, time=float(k)), status)
    behind = recorder.dropped()["recorder_behind"]
    with pipe.open("rb") as reader:
        reader.read()
    recorder.close()
    kept = [line["time"] for line in index(tmp_path)]
    assert behind in (shown - QUEUE_IMAGES, shown - QUEUE_IMAGES - 1)  # one may be in the writer's hands
    assert len(kept) + behind == shown
    assert kept == [float(k) for k in range(len(kept))]  # what was queued first is kept, in order


def test_unwritable_images_are_counted_and_told_at_the_end(tmp_path, image, status):
    recorder = Recorder(tmp_path, hz=1000.0)
    (tmp_path / "000000.jpg").mkdir()  # in the way of the first image
    recorder.show(image(1), status)
    with pytest.raises(RunError, match="1 images could not be recorded: Is a directory"):
        recorder.close()
    assert recorder.dropped() == {"recorder_unwritten": 1}


def test_old_recording_is_replaced(tmp_path, image, status):
    for count in (3, 1):
        recorder = Recorder(tmp_path, hz=1000.0)
        for k in range(count):
            recorder.show(image(k + 1, time=float(k)), status)
        recorder.close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["000000.jpg", "index.jsonl"]


def test_closing_twice_is_harmless(tmp_path):
    recorder = Recorder(tmp_path, hz=1.0)
    recorder.close()
    recorder.close()
