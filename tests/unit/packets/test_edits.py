"""Edits on the wire: what was sent comes back, and any bytes give values or a refusal."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wall.core.data import STILL, Edits, Event
from wall.core.errors import LocalProtocolError, RemoteProtocolError
from wall.packets.control import EditAnswer, EditRequest, parse_control, serialise
from wall.packets.edits import MAX_NUMBERS, edits_body, parse_edits

EVENT = Event(view=0, camera_event=1, scene_event=2, scene_time=3.0, input_time=4.0, camera=STILL)
NUMBERS = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=MAX_NUMBERS).map(tuple)
NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=40)
EDITS = st.builds(
    lambda number, values: Edits(number, tuple(sorted(values.items()))),
    st.integers(0, 2**32 - 1),
    st.dictionaries(NAMES, NUMBERS, max_size=8),
)


@given(EDITS, st.floats(-20, 20))
def test_an_event_brings_its_edits(edits: Edits, exposure: float) -> None:
    event = replace(EVENT, edits=edits, exposure=exposure)
    assert parse_control(serialise(event)) == event


@given(st.binary(max_size=200))
def test_any_bytes_are_edits_or_refused(body: bytes) -> None:
    try:
        edits = parse_edits(7, body)
    except RemoteProtocolError:
        return
    assert edits_body(edits) == body


@given(EDITS.filter(lambda edits: len(edits.values) > 0), st.data())
def test_edits_that_were_cut_or_changed_are_edits_or_refused(edits: Edits, data: st.DataObject) -> None:
    body = bytearray(edits_body(edits))
    at = data.draw(st.integers(0, len(body) - 1))
    body[at] ^= 1 << data.draw(st.integers(0, 7))
    for changed in (bytes(body), bytes(body[:at])):
        try:
            assert edits_body(parse_edits(edits.number, changed)) == changed
        except RemoteProtocolError:
            continue


def test_names_come_in_order_and_once() -> None:
    one = edits_body(Edits(1, (("b", (1.0,)),)))
    for body in (one + one, one + edits_body(Edits(1, (("a", (1.0,)),)))):
        with pytest.raises(RemoteProtocolError, match="in order"):
            parse_edits(1, body)


@pytest.mark.parametrize("values", [(("", (1.0,)),), (("x" * 256, (1.0,)),), (("x", ()),), (("x", (1.0,) * 17),)])
def test_what_does_not_fit_is_not_sent(values: tuple[tuple[str, tuple[float, ...]], ...]) -> None:
    with pytest.raises(LocalProtocolError):
        serialise(replace(EVENT, edits=Edits(1, values)))


def test_numbers_that_are_not_finite_are_not_sent() -> None:
    with pytest.raises(LocalProtocolError):
        serialise(replace(EVENT, edits=Edits(1, (("x", (float("inf"),)),))))


def test_requests_and_answers_come_back() -> None:
    for message in (
        EditRequest(
            client=1 << 32,
            number=2,
            key="k",
            assignments=[["a", 1.5], ["b", [1, 2]], ["c", None]],
            listed=["a*"],
            undo=1,
            commands=[{"kind": "orbit", "x": 0.5, "y": 0, "view": "map"}],
        ),
        EditAnswer(
            client=1 << 32, number=2, refused="why", edit=3, parameters=[{"name": "a", "value": [1.0]}], left_out=2
        ),
    ):
        assert parse_control(serialise(message)) == message
