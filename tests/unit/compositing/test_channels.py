"""Which channels flow: what somebody after a node needs, and what the node itself compares."""

from __future__ import annotations

from equalizer_texts import draws, one_panel, takes

from wall.config.loading import loads
from wall.importers.command import convert_text
from wall.roles.plan import make_layout


def test_a_join_by_depth_holds_the_depths_that_it_compares() -> None:
    compounds = "buffer [ COLOR DEPTH ] compound { range [ 0 .5 ] } " + draws("b", "range [ .5 1 ]") + takes("b")
    _, _, yaml = convert_text(one_panel(compounds), "f.eqc")
    graph = make_layout(loads(yaml)).graph
    assert graph.step("a.d").channels == {"colour", "depth"}  # nobody after it needs depth, its operator writes it
    assert graph.step("wall").channels == {"colour"}
