"""What is timed is a whole adaptive renderer; how fast it is decides no test."""

from __future__ import annotations

import pytest

from wall.study.speed import adaptive_cost, record, speed
from wall.study.speed.adaptive_cost import MEASURED, REFRESH_HZ, SETTLED, Session

SMALL = (64, 36)


def test_session_charges_every_stage_and_counts_its_samples(compiled_only: None) -> None:
    session = Session(SMALL)
    assert sum(len(batch.samples) for batch in session.first_image()) == SMALL[0] * SMALL[1]
    session.refresh(0.0)
    batches = [session.step(k / 1000, 64) for k in range(1, 4)]
    assert session.samples == sum(len(batch.samples) for batch in batches) == 3 * 64
    assert set(session.seconds) == {"refresh", *adaptive_cost.CONTROL, "encode", "trace"}
    assert len({batch.camera.position for batch in batches}) == 3


def test_live_session_refreshes_its_image_and_ends(compiled_only: None) -> None:
    session = Session(SMALL)
    session.first_image()
    adaptive_cost.live(session, 0.05)
    assert session.samples > 0
    assert sum(session.seconds.values()) > 0.0


def test_reconstruction_is_given_its_rate_and_more_than_a_sample_a_pixel(
    monkeypatch: pytest.MonkeyPatch, compiled_only: None
) -> None:
    monkeypatch.setitem(adaptive_cost.PANELS, "small", (SMALL, 1.0))
    (row,) = adaptive_cost.display_side("small")
    stored = float(row.note.split("; ")[1].partition("k")[0]) * 1e3
    assert SMALL[0] * SMALL[1] < stored < SMALL[0] * SMALL[1] + adaptive_cost.RATE / REFRESH_HZ * (SETTLED + MEASURED)
    assert row.value is not None
    assert row.value > 0.0
    assert row.met == (row.value <= 1.0)


def test_figure_without_a_bar_is_neither_met_nor_skipped() -> None:
    reported = record.reported("reconstruct_1080", 3.0, unit="cores")
    skipped = record.skipped("mitsuba_llvm", "u", "b", "absent")
    cells = list(speed.table([reported, skipped]).columns[-1].cells)
    assert cells == ["skipped", ""]  # in the order of metrics
