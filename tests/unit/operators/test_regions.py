"""Of every operator: the same pixels region by region as at once, and no change outside what it says is touched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from framelets import applied, assert_equal, by_regions, made, random_framelet, rect
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from wall.core.data import ORIGIN_STEP_S, Framelet, Rect
from wall.operators.base import Operator
from wall.operators.curve import Curve, CurvedImage
from wall.operators.registry import OPERATORS

THREE = ("a", "b", "c")
PLACES = [rect(0, 0, 11, 9), rect(2, -3, 11, 9), rect(-4, 2, 7, 8)]
BENT = {"columns": 3, "rows": 2, "points": [[0.1, 0.0], [0.5, 0.1], [1.0, 0.05], [0.0, 0.9], [0.45, 1.1], [0.9, 1.0]]}
ARC = np.linspace(-0.5, 0.5, 11)
BOWL = CurvedImage(  # 11 x 9 points of a cylinder behind a window in the plane z = 0
    centres=lambda: np.stack(np.broadcast_arrays(ARC, np.linspace(0.4, -0.4, 9)[:, None], -(1 - ARC**2)), axis=-1),
    window=np.array([[-0.5, 0.4, 0.0], [0.1, 0.0, 0.0], [0.0, -0.1, 0.0]]),
    eye=np.array([0.1, 0.0, 1.5]),
    tracked=True,
)
CASES: dict[str, tuple[Operator, int]] = {  # the operator, and how many inputs it gets
    "age_blend": (made(OPERATORS["age_blend"], inputs=THREE, tau_s=0.7), 3),
    "average": (made(OPERATORS["average"], inputs=THREE), 3),
    "blend_edges": (made(OPERATORS["blend_edges"], input="a", left=4, top=3, bottom=1), 1),
    "blend_mask": (made(OPERATORS["blend_mask"], input="a", file="spot.png"), 1),
    "colour": (made(OPERATORS["colour"], input="a", gain=(1.5, 0.5, 1.0), gamma=1.7, lut="warm.cube", opacity=0.8), 1),
    "constant": (made(OPERATORS["constant"], area=(3, 4, 9, 8), colour=(0.1, 2.0, 0.3), alpha=0.5, depth=4.0), 0),
    "crop": (made(OPERATORS["crop"], input="a", area=(-1, 1, 9, 9)), 1),
    "curve": (Curve(op="curve", id="it", input="a", panel="p").placed(BOWL), 1),
    "deep_zoom": (made(OPERATORS["deep_zoom"], area=(-2, 3, 23, 19), file="spot.png", x=0.4, zoom=0.3), 0),
    "denoise": (made(OPERATORS["denoise"], input="a"), 1),
    "depth": (made(OPERATORS["depth"], inputs=THREE), 3),
    "encode": (made(OPERATORS["encode"], input="a"), 1),
    "flip": (made(OPERATORS["flip"], input="a", axis="horizontal"), 1),
    "flip vertically": (made(OPERATORS["flip"], input="a", axis="vertical"), 1),
    "legend": (
        made(
            OPERATORS["legend"], input="a", color_map={"name": "viridis", "range": (0, 1)}, area=(2, 3, 26, 26), size=6
        ),
        1,
    ),
    "mask": (made(OPERATORS["mask"], input="a", file="spot.png"), 1),
    "mask of an area": (made(OPERATORS["mask"], input="a", area=(3, 2, 5, 20), invert=True), 1),
    "newest": (made(OPERATORS["newest"], inputs=THREE), 3),
    "over": (made(OPERATORS["over"], inputs=THREE), 3),
    "outline": (made(OPERATORS["outline"], input="a", width=3, sides=("top", "right")), 1),
    "overlay": (made(OPERATORS["overlay"], input="a", text="ab", size=6, at="bottom_right"), 1),
    "image": (made(OPERATORS["image"], area=(-2, 3, 11, 9), file="spot.png", depth=2.0), 0),
    "rotate": (made(OPERATORS["rotate"], input="a", degrees=90), 1),
    "rotate by 180": (made(OPERATORS["rotate"], input="a", degrees=180), 1),
    "rotate by 270": (made(OPERATORS["rotate"], input="a", degrees=270), 1),
    "scale by box": (made(OPERATORS["scale"], input="a", size=(5, 7), filter="box"), 1),
    "scale by triangle": (made(OPERATORS["scale"], input="a", factor=2.0, filter="triangle"), 1),
    "scale by catmull_rom": (made(OPERATORS["scale"], input="a", factor=(0.6, 1.4), filter="catmull_rom"), 1),
    "scale": (made(OPERATORS["scale"], input="a", factor=0.3, filter="lanczos3"), 1),
    "tile": (made(OPERATORS["tile"], inputs=THREE), 3),
    "warp": (made(OPERATORS["warp"], input="a", mesh=BENT), 1),
}
cuts = st.lists(st.integers(-4, 24), max_size=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the files of the cases lie."""
    made_in = tmp_path_factory.mktemp("files")
    rng = np.random.default_rng(3)
    rows = "\n".join(" ".join(f"{v:.3f}" for v in row) for row in rng.random((27, 3)))
    (made_in / "warm.cube").write_text(f"LUT_3D_SIZE 3\n{rows}\n")
    Image.fromarray(rng.integers(0, 256, (9, 11, 4), np.uint8) // 2 * 2, "RGBA").save(made_in / "spot.png")
    return made_in


def inputs_of(name: str, seed: int) -> list[Framelet]:
    rng = np.random.default_rng(seed)
    inputs = [random_framelet(rng, place, order=(3 * k) % 2) for k, place in enumerate(PLACES[: CASES[name][1]])]
    for k, framelet in enumerate(inputs):
        framelet.channel("time")[...] += 0.3 * k
        framelet.stamp(k * ORIGIN_STEP_S)
    return inputs


def test_every_operator_is_tested_here() -> None:
    assert {name.split()[0] for name in CASES} == set(OPERATORS)


@pytest.mark.parametrize("name", CASES)
@settings(deadline=None, max_examples=12)
@given(xs=cuts, ys=cuts, seed=st.integers(0, 9))
def test_region_by_region_equals_the_whole(name: str, folder: Path, xs: list[int], ys: list[int], seed: int) -> None:
    operator, inputs = CASES[name][0], inputs_of(name, seed)
    whole = applied(operator, *inputs, encoded=name == "encode", refreshed_at=ORIGIN_STEP_S, folder=folder)
    assert_equal(by_regions(operator, inputs, (xs, ys), whole, folder), whole)


@pytest.mark.parametrize("name", [name for name, (_, count) in CASES.items() if count > 0])
@settings(deadline=None, max_examples=12)
@given(data=st.data(), seed=st.integers(0, 9))
def test_a_change_touches_no_more_than_the_operator_says(
    name: str, folder: Path, data: st.DataObject, seed: int
) -> None:
    operator, inputs, others = CASES[name][0], inputs_of(name, seed), inputs_of(name, seed + 100)
    k = data.draw(st.integers(0, len(inputs) - 1))
    whole = inputs[k].rect
    x, y = data.draw(st.integers(whole.x, whole.right - 1)), data.draw(st.integers(whole.y, whole.bottom - 1))
    width, height = data.draw(st.integers(1, whole.right - x)), data.draw(st.integers(1, whole.bottom - y))
    changed = rect(x, y, width, height)
    before = applied(operator, *inputs, encoded=name == "encode", folder=folder)
    for channel in inputs[k].channels:
        here = changed.inside(whole)
        inputs[k].channel(channel)[here] = others[k].channel(channel)[here]
    after = applied(operator, *inputs, encoded=name == "encode", folder=folder)
    touched = operator.touched(changed, [framelet.rect for framelet in inputs], k)
    for channel in before.channels:
        differs = before.channel(channel) != after.channel(channel)
        assert_inside(differs.reshape(*differs.shape[:2], -1).any(axis=2), touched, before.rect)


def assert_inside(differs: np.ndarray, touched: Rect, whole: Rect) -> None:
    rows, columns = np.nonzero(differs)
    assert (columns + whole.x >= touched.x).all()
    assert (columns + whole.x < touched.right).all()
    assert (rows + whole.y >= touched.y).all()
    assert (rows + whole.y < touched.bottom).all()
