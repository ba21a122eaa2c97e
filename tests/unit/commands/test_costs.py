"""What `wall check --costs` and `wall measure features` say: a table of features, and what they take."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.table import Table

from wall.commands.costs import Bench, Cost, in_turn, left_out, table_of
from wall.config.loading import loads
from wall.roles.plan import Plan, make_layout, make_plan
from wall.scene.features import features

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [40, 36], size: [0.4, 0.36]}}
views: [{camera: {position: [6, 4.5, 10], target: [0, 0.6, 0]}}]
sampling: {method: frameless, samples_per_batch: 64}
"""


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(make_layout(loads(TEXT, path=Path("wall.yaml"))))


def rows(table: Table) -> dict[str, list[str]]:
    """Cells of each row by the first one."""
    columns = [[str(cell) for cell in column.cells] for column in table.columns]
    return {name: list(cells) for name, *cells in zip(*columns, strict=True)}


def test_features_that_are_in_have_rows_with_what_was_measured_and_others_are_named(plan: Plan) -> None:
    found = rows(table_of(plan.scene, "x", {"mirrors": Cost(ns=41.6, bytes=0.004)}))
    assert found["mirrors"][-2:] == ["+42", "+0.00"]
    assert found["relighting"][2:] == ["normal, light visibility", "with another", ""]
    assert "cuts" not in found
    absent = left_out(plan.scene).split(": ")[1].split(", ")
    assert sorted([*found, *absent]) == sorted(feature.name for feature in features(plan.scene))


def test_a_bench_counts_bytes_of_what_is_sent(plan: Plan, compiled_only: None) -> None:
    """Whole rounds of the sampler: 40 x 36 samples of 8 bytes, in packets of at most 64 with 170 bytes of header."""
    bench = Bench(plan, plan.scene)
    whole, again = in_turn([bench, bench], rounds=1, seconds=0.02)
    assert 0.0 < whole.ns < 1e9
    assert abs(whole.bytes - (8.0 + 170 / 64)) < 0.5
    assert abs(again.bytes - whole.bytes) < 0.5


def test_memory_and_reasons_are_those_of_the_courtyard(plan: Plan) -> None:
    """One image of 1024 x 1024 texels, three bytes each, its mip levels a third more; texture coordinates beside it."""
    scene = plan.scene
    found = {feature.name: feature for feature in features(scene)}
    uvs = sum(mesh.uvs.nbytes for mesh in scene.meshes if mesh.uvs is not None)
    assert found["textures"].bytes == round(1024 * 1024 * 3 * 4 / 3) + uvs
    assert found["textures"].why.startswith("1 images of 1 materials")
    assert found["instancing"].bytes < 0
    assert found["instancing"].why == f"{len(scene.instances)} objects of {len(scene.meshes)} meshes"
    assert found["relighting"].fields == ("normal", "light visibility")
    assert (found["paths"].used, found["sky"].used) == (False, True)
