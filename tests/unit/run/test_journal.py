"""The log at the head: a line for each note, files of bounded size, and what failed can be found again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from flat_batches import plan_of
from manager_run import Run, hello

from wall.core.data import Event
from wall.packets.control import parse_control
from wall.packets.notes import Note, note_of
from wall.roles.instructions import Died, Input, Instruction
from wall.roles.plan import HEAD, first_event
from wall.run.clock import HeadClock
from wall.run.journal import Journal
from wall.run.loop import Loop
from wall.run.ports import Ports
from wall.run.tracers import BatchError
from wall.transport.loopback import LoopbackHub, LoopbackLink


def lines(out: Path, name: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in (out / "log" / name).read_text().splitlines()]


def test_a_note_is_a_line_of_its_rank_with_host_level_and_replay_coordinates(tmp_path: Path) -> None:
    journal = Journal(tmp_path, "host{}".format)
    for note in (note_of(3, "error", "no\nray", {"batch": 117}), note_of(1, "info", "takes part")):
        journal.take(note)
    journal.close()
    [failed], [took_part] = lines(tmp_path, "rank-3.jsonl"), lines(tmp_path, "rank-1.jsonl")
    assert str(failed.pop("time")).endswith("Z")
    assert failed == {
        "rank": 3, "host": "host3", "level": "error", "message": "no\nray", "replay": {"batch": 117},
    }  # fmt: skip
    assert "replay" not in took_part


def test_a_log_goes_on_with_that_of_the_run_before_and_stays_bounded(tmp_path: Path) -> None:
    for run in range(3):
        journal = Journal(tmp_path, lambda rank: "", most_bytes=1000)
        for number in range(20):
            journal.take(note_of(2, "info", f"{run} {number}"))
        journal.close()
    old, new = (lines(tmp_path, f"rank-2{which}.jsonl") for which in (".1", ""))
    told = [line["message"] for line in (*old, *new)]
    assert told == [f"{run} {number}" for run in range(3) for number in range(20)][-len(told) :]
    assert 10 <= len(told) < 60
    assert all(path.stat().st_size < 1200 for path in (tmp_path / "log").iterdir())
    assert len(list((tmp_path / "log").iterdir())) == 2


def test_a_log_that_cannot_be_written_says_why_and_holds_nobody_up(tmp_path: Path) -> None:
    (tmp_path / "log").touch()
    journal = Journal(tmp_path, lambda rank: "")
    journal.take(note_of(0, "info", "lost"))
    journal.close()
    assert journal.failure == f"{tmp_path / 'log'}: File exists"


class Fails:
    """A role that cannot trace a batch."""

    due = 0.0

    def __init__(self, event: Event) -> None:
        self._event = event

    def on_message(self, message: Input, now: float) -> Iterator[Instruction]:
        yield from ()

    def on_tick(self, now: float) -> Iterator[Instruction]:
        raise BatchError("rank 3, batch 117: no ray", 117, self._event)


def test_what_ends_a_rank_is_told_to_the_manager_before() -> None:
    control, event = LoopbackHub(credit_bytes=1 << 20), replace(first_event(plan_of(), 0.0), camera_event=9)
    ports = Ports(3, HeadClock(), hub=None, manager=LoopbackLink(control.endpoint))
    with pytest.raises(BatchError):
        Loop(Fails(event), ports, HeadClock()).run()
    [told] = [parse_control(data) for _, data in control.messages()]
    number = {"batch": 117, "camera_event": 9, "scene_event": event.scene_event}
    assert told == Note(rank=3, level="error", text="rank 3, batch 117: no ray", replay=number)
    ports.close()


def test_the_manager_gathers_notes_and_its_page_gets_all_but_those_for_the_log_alone() -> None:
    run = Run(plan_of())
    run.tell(hello(1), note_of(1, "warning", "no GPU"), note_of(7, "error", "a stranger's"))
    sent = run.tell(note_of(1, "error", "no ray"), Died(1, "signal 9"), after=0.1)
    *told, last = [(note.level, note.text) for note in run.manager.register.take_notes()]
    assert told == [
        ("info", "takes part, on host1"), ("warning", "no GPU"), ("error", "no ray"), ("info", "died (signal 9)"),
    ]  # fmt: skip
    assert last[0] == "warning"
    assert last[1].endswith("; it is not started again now")
    assert [(to, message.text) for to, message in sent if isinstance(message, Note)] == [
        (HEAD, "no ray"), (HEAD, last[1]),
    ]  # fmt: skip
    assert run.manager.counters["bad_message"] == 1
    assert run.manager.register.take_notes() == []
