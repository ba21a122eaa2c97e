"""Credit as arithmetic, over a wire that delivers, loses and breaks as hypothesis likes."""

from __future__ import annotations

from collections import Counter, deque

from hypothesis import given, settings
from hypothesis import strategies as st

from wall.transport.credit import QUEUED_PACKETS, HubCredit, LinkCredit

WINDOW = 1000
LARGEST = 1500  # above the window, too
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("offer"), st.integers(1, LARGEST)),
        st.tuples(st.sampled_from(["deliver", "consume", "ask", "lose grant", "break", "restart"]), st.just(0)),
    ),
    max_size=120,
)


class Wire:
    """One link, one hub, and the packets between them and at the hub, in order."""

    def __init__(self) -> None:
        self.link, self.hub = LinkCredit(Counter[str]()), HubCredit(WINDOW)
        self.flying: deque[int] = deque()
        self.held: deque[int] = deque()
        self.grants_arrive = True
        self.grant()

    def grant(self) -> None:
        limit = self.hub.due()
        if limit is not None and self.grants_arrive:
            self.link.grant(limit, WINDOW)
        self.grants_arrive = True

    def step(self, what: str, size: int) -> None:
        if what == "offer":
            self.link.offer(bytes(size), self.send)
        elif what == "deliver" and self.flying:
            self.held.append(self.flying.popleft())
            assert self.hub.arrive(self.held[-1])
        elif what == "consume" and self.held:
            self.hub.consume(self.held.popleft())
            self.grant()
        elif what == "ask":
            self.ask()
        elif what == "lose grant":
            self.grants_arrive = False
        elif what == "break":
            self.flying.clear()
        elif what == "restart":
            self.flying.clear()
            self.held.clear()
            self.hub = HubCredit(WINDOW)
        self.link.flush(self.send)

    def send(self, packet: bytes) -> bool:
        self.flying.append(len(packet))
        return True

    def ask(self) -> None:
        """In order behind the data, as on a connection."""
        while self.flying:
            self.step("deliver", 0)
        self.hub.resume(self.link.sent)
        self.grant()

    @property
    def under_way(self) -> int:
        return sum(self.flying) + sum(self.held)


@given(steps=STEPS)
@settings(max_examples=300, deadline=None)
def test_the_window_is_never_exceeded_and_an_ask_always_ends_in_credit(steps: list[tuple[str, int]]) -> None:
    wire = Wire()
    for what, size in steps:
        wire.step(what, size)
        assert wire.under_way <= WINDOW or len(wire.flying) + len(wire.held) == 1
    for _ in range(2 + QUEUED_PACKETS):
        wire.grants_arrive = True
        wire.step("ask", 0)
        while wire.held:
            wire.step("consume", 0)
    assert wire.link.ready
    assert wire.under_way == 0


def test_asking_while_packets_lie_at_the_hub_grants_nothing() -> None:
    wire = Wire()
    for _ in range(12):
        wire.step("offer", 100)
    for _ in range(50):
        wire.ask()
    assert wire.under_way == WINDOW
    assert not wire.link.ready


def test_what_was_lost_on_the_way_is_paid_back_on_asking() -> None:
    wire = Wire()
    for _ in range(10):
        wire.step("offer", 100)
    wire.step("break", 0)
    assert not wire.link.ready
    wire.ask()
    assert wire.link.ready


def test_grants_are_spared_while_more_packets_lie_at_the_hub() -> None:
    hub = HubCredit(WINDOW)
    assert hub.due() == WINDOW
    for _ in range(5):
        hub.arrive(100)
    hub.consume(100)
    assert hub.due() is None
    hub.consume(150)
    assert hub.due() == WINDOW + 250
    hub.consume(250)
    assert hub.due() == WINDOW + 500
    assert hub.due() is None


def test_a_hub_refuses_what_goes_beyond_the_credit() -> None:
    hub = HubCredit(WINDOW)
    assert hub.arrive(600)
    assert not hub.arrive(600)
    assert hub.arrive(400)


def test_consuming_more_than_arrived_gives_no_credit() -> None:
    hub = HubCredit(WINDOW)
    hub.due()
    hub.consume(10_000)
    assert hub.due() is None


def test_before_the_first_grant_nothing_is_sent_and_the_newest_packets_are_kept() -> None:
    link, sent = LinkCredit(Counter[str]()), []
    dropped = [old for k in range(5) for old in link.offer(bytes([k]), lambda p: bool(sent.append(p) or True))]
    assert not link.ready
    assert (sent, dropped) == ([], [b"\0", b"\1", b"\2"])
    link.grant(WINDOW, WINDOW)
    link.flush(lambda p: bool(sent.append(p) or True))
    assert sent == [b"\3", b"\4"]


def test_a_full_socket_keeps_packets_waiting() -> None:
    link = LinkCredit(Counter[str]())
    link.grant(WINDOW, WINDOW)
    assert link.offer(b"a", lambda _: False) == []
    assert (link.sent, link.ready) == (0, False)
