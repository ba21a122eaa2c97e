"""`wall measure balance`: a wall with and without moving borders, and what the table makes of the runs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout
from wall.study.live.balance import Row, _with_balance, check_ranks, report

BALANCE = Path(__file__).parents[3] / "configs/balance.yaml"
ROW = Row(
    config="wall", method="framed", balance=False, renderers=2, evenness=0.5, largest_cost=2.0, samples_per_s=1e6,
    assignments=0, other_cores=0.0, commit="", machine="", command="",
)  # fmt: skip


@pytest.mark.parametrize("balance", [False, True])
def test_the_wall_runs_with_so_many_renderers_a_panel(balance: bool) -> None:
    layout = make_layout(_with_balance(load(BALANCE), 3, balance))
    assert (len(layout.regions), layout.strips is not None) == (6, balance)


@pytest.mark.parametrize(("evenness", "word"), [(0.85, "yes"), (0.84, "MISSED")])
def test_strips_must_be_nearly_even_and_the_largest_tells_the_gain(evenness: float, word: str, tmp_path: Path) -> None:
    balanced = replace(ROW, balance=True, evenness=evenness, largest_cost=1.25)
    console = Console(record=True, width=160)
    for item in report([ROW, balanced, replace(balanced, evenness=0.99), replace(balanced, evenness=0.1)], tmp_path):
        console.print(item)
    text = console.export_text()
    assert word in text, "the median counts"
    assert "1.60x" in text


def test_what_has_no_borders_to_move_is_refused() -> None:
    with pytest.raises(ConfigError, match="only presets have `balance`"):
        _with_balance(load(BALANCE.parent / "graphs/mixed_sinks.yaml"), 1, True)
    with pytest.raises(ConfigError, match="--ranks 0: wanted numbers of ranks a panel from 1 to 64"):
        check_ranks("1,0")
