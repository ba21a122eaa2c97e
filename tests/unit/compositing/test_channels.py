"""Which channels flow: what somebody after a node needs, and what the node itself compares."""

from __future__ import annotations

import pytest
from equalizer_texts import draws, one_panel, takes
from small_graphs import built, nodes

from wall.config.loading import loads
from wall.importers.command import convert_text
from wall.roles.plan import make_layout


def test_a_join_by_depth_holds_the_depths_that_it_compares() -> None:
    compounds = "buffer [ COLOR DEPTH ] compound { range [ 0 .5 ] } " + draws("b", "range [ .5 1 ]") + takes("b")
    _, _, yaml = convert_text(one_panel(compounds), "f.eqc")
    graph = make_layout(loads(yaml)).graph
    assert graph.step("a.d").channels == {"colour", "depth"}  # nobody after it needs depth, its operator writes it
    assert graph.step("wall").channels == {"colour"}


@pytest.mark.parametrize(
    ("background", "wanted"), [("keep", {"colour", "albedo", "normal"}), ("transparent", {"colour"})]
)
def test_albedos_and_normals_are_made_for_denoise_alone(background: str, wanted: set[str]) -> None:
    """Of an opaque layer: one that shows no sky would have to know how much of each pixel it covers."""
    lines = [
        "id: s0, op: samples, panel: r0c0", f"id: p0, op: reconstruct, input: s0, background: {background}",
        "id: s1, op: samples, panel: r0c1", "id: p1, op: reconstruct, input: s1",
        "id: d, op: denoise, input: p0", "id: w, op: tile, inputs: [d, p1]", "id: png, op: sink, kind: png, input: w",
    ]  # fmt: skip
    graph = built(nodes(*lines))
    assert graph.step("p0").channels == wanted
    assert graph.step("p1").channels == graph.step("d").channels == {"colour"}
