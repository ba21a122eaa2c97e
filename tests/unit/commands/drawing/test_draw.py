"""The page: to scale, everything on it and nothing over anything else, in every format."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from small_diagrams import binary_tree, graph, sort_first, upright
from typer.testing import CliRunner

from wall import cli
from wall.commands.drawing.diagram import diagram_of
from wall.commands.drawing.draw import compose, draw
from wall.commands.drawing.model import TIMES
from wall.commands.drawing.page import Page, rendered
from wall.config.loading import load, loads
from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.roles.plan import make_layout

CONFIGS = Path(__file__).parents[4] / "configs"
SHIPPED = sorted(CONFIGS.rglob("*.yaml"))
SVG = "{http://www.w3.org/2000/svg}"
POINTS_A_MM = 72 / 25.4
SKETCHES = {
    "tree": binary_tree(8),
    "bundles": sort_first(1024, compositors=4),
    "overlaps": graph(
        {"s": ("samples", "rank 1", ()), "p": ("reconstruct", "head", ("s",))},
        screens=[upright("projector-a", 0.0, 0.0), upright("projector-b", 0.8, 0.0)],
    ),
}


def page_of(path: Path) -> Page:
    return compose(diagram_of(make_layout(load(path)), samples_per_s=1e6))


def svg_of(page: Page) -> ElementTree.Element:
    return ElementTree.fromstring(rendered(page, "svg", title="test"))


def outline(svg: ElementTree.Element, name: str) -> Float64:
    """(n, 2) corners in points, y down, of what has an id."""
    path = svg.find(f".//{SVG}g[@id='{name}']/{SVG}path")
    assert path is not None, name
    numbers = re.findall(r"[ML] (\S+) (\S+)", path.attrib["d"])
    return np.array(numbers, dtype=np.float64)


def texts(svg: ElementTree.Element) -> list[str]:
    return [text.text or "" for text in svg.iter(f"{SVG}text")]


def inside(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether two boxes have an area in common."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def check_text(page: Page) -> None:
    """All text on the page, and none over other text."""
    for words in page.texts:
        left, top, right, bottom = words.box()
        assert left >= 0, words.text
        assert top >= 0, words.text
        assert right <= page.width, words.text
        assert bottom <= page.height, words.text
    for a, b in combinations(page.texts, 2):
        assert not inside(a.box(), b.box()), (a.text, b.text)


def test_panels_are_to_the_scale_of_the_bar() -> None:
    """two_by_two: panels of 0.32 x 0.18 m without bezels, so r1c1 begins where r0c0 ends."""
    svg = svg_of(page_of(CONFIGS / "two_by_two.yaml"))
    bar = outline(svg, "scale-bar")
    (label,) = [text for text in texts(svg) if re.fullmatch(r"\d+ cm", text)]
    points_a_metre = (bar[1, 0] - bar[0, 0]) / (float(label.removesuffix(" cm")) / 100)
    first, last = outline(svg, "panel-r0c0"), outline(svg, "panel-r1c1")
    size = np.ptp(first, axis=0) / points_a_metre
    assert size == pytest.approx(np.array([0.32, 0.18]), rel=1e-4)
    assert (last.min(axis=0) - first.min(axis=0)) / points_a_metre == pytest.approx(np.array([0.32, 0.18]), rel=1e-4)


def test_both_views_have_one_scale_and_one_x() -> None:
    page = page_of(CONFIGS / "one_panel.yaml")
    svg = svg_of(page)
    panel, eye = outline(svg, "panel-r0c0"), outline(svg, "eye")
    assert eye[:, 0].mean() == pytest.approx(panel[:, 0].mean(), abs=0.1)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_configuration_draws_all_its_panels_and_nodes(path: Path) -> None:
    layout = make_layout(load(path))
    page = compose(diagram_of(layout, samples_per_s=1e6))
    svg = svg_of(page)
    written = texts(svg)
    joined = "".join(written)
    thinned = any(" … " in text for text in written)  # a large wall: first and last names only
    for panel in layout.wall.panels:
        assert len(np.unique(outline(svg, f"panel-{panel.id}"), axis=0)) == 4
        assert panel.of in joined or thinned
    if thinned:
        check_text(page)
        return
    for node in layout.graph.nodes:
        assert len(outline(svg, f"node-{node.id}")) == 4
        assert node.id in written
        for source in node.sources:
            assert len(outline(svg, f"edge-{source}-{node.id}")) >= 2
    check_text(page)


@pytest.mark.parametrize("width", [85.0, 178.0])
@pytest.mark.parametrize("name", SKETCHES)
def test_text_stays_on_the_page_and_apart_however_wide_it_is(name: str, width: float) -> None:
    check_text(compose(SKETCHES[name], width=width))


def test_expected_traffic_is_written_at_its_edge() -> None:
    """two_compositors: 1 M samples/s a rank of 6.5 bytes (adaptive); 320 x 240 pixels of 3 bytes, 30 a second."""
    written = texts(svg_of(page_of(CONFIGS / "two_compositors.yaml")))
    assert written.count("13 MB/s") == 1  # two ranks
    assert written.count("6.5 MB/s") == 1
    assert written.count("6.91 MB/s") == 1
    assert "rank 0, in 19.9 MB/s" in written  # 13 + 6.91


def test_edges_between_processes_differ_from_calls() -> None:
    page = page_of(CONFIGS / "two_compositors.yaml")
    styles = {
        stroke.gid: (stroke.line, stroke.width) for stroke in page.strokes if (stroke.gid or "").startswith("edge-")
    }
    crossing = {styles[name] for name in ("edge-left-samples-left", "edge-right-samples-right", "edge-right-wall")}
    calls = {styles[name] for name in ("edge-left-wall", "edge-wall-page", "edge-wall-files")}
    assert len(crossing) == len(calls) == 1
    assert crossing != calls


def test_overlaps_of_projectors_are_hatched() -> None:
    page = compose(SKETCHES["overlaps"])
    (hatched,) = [stroke for stroke in page.strokes if stroke.gid == "overlap"]
    a, b = (np.ptp(s.points, axis=0) for s in page.strokes if (s.gid or "").startswith("panel-projector"))
    assert np.ptp(hatched.points, axis=0) == pytest.approx(np.array([0.2 * a[0], a[1]]))
    assert a == pytest.approx(b)
    assert "lit by two panels" in [words.text for words in page.texts]


def test_each_process_has_its_own_colour() -> None:
    page = compose(sort_first(6, compositors=3))
    fills = {stroke.gid: stroke.fill for stroke in page.strokes if (stroke.gid or "").startswith("process-")}
    assert len(fills) == len(set(fills.values())) == 3


def test_a_thousand_panels_still_fit_a_page() -> None:
    text = (CONFIGS / "one_panel.yaml").read_text(encoding="utf-8")
    text = text.replace("columns: 1, rows: 1", "columns: 15, rows: 16")
    page = compose(diagram_of(make_layout(loads(text, name="large.yaml")), samples_per_s=1e6))
    check_text(page)
    assert page.width < 260
    assert page.height < 180
    written = [words.text for words in page.texts]
    assert "r0c0 … r15c14" in written  # ids do not fit the panels
    assert f"240 {TIMES} 6.5 MB/s" in written


@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_the_same_page_gives_the_same_bytes(kind: str) -> None:
    page = compose(SKETCHES["overlaps"])
    assert rendered(page, kind, title="a") == rendered(page, kind, title="a")


def test_png_is_the_page_at_300_dpi_and_not_blank(tmp_path: Path) -> None:
    target = tmp_path / "wall.png"
    page = draw(load(CONFIGS / "demo.yaml"), target, samples_per_s=1e6)
    with Image.open(target) as image:
        assert image.size == pytest.approx((page.width / 25.4 * 300, page.height / 25.4 * 300), abs=1.0)
        grey = np.asarray(image.convert("L"))
    assert 0.005 < np.mean(grey < 100) < 0.2
    assert np.mean(grey > 200) > 0.5


def test_command_writes_a_pdf_and_says_how_large(tmp_path: Path) -> None:
    target = tmp_path / "wall.pdf"
    result = CliRunner().invoke(cli.app, ["draw", str(CONFIGS / "one_panel.yaml"), "-o", str(target)])
    assert result.exit_code == 0, result.output
    assert target.read_bytes().startswith(b"%PDF")
    assert re.search(r"wrote.*wall\.pdf:\d+x\d+mm", "".join(result.output.split()))  # lines end anywhere
    assert list(tmp_path.iterdir()) == [target]


def test_command_takes_the_rate_of_a_rank(tmp_path: Path) -> None:
    target = tmp_path / "wall.svg"
    options = ["draw", str(CONFIGS / "demo.yaml"), "-o", str(target), "--samples-per-s", "500000"]
    assert CliRunner().invoke(cli.app, options).exit_code == 0
    assert texts(ElementTree.parse(target).getroot()).count("3.25 MB/s") == 4  # 6.5 bytes a sample


@pytest.mark.parametrize(
    ("name", "message"),
    [("wall.jpg", r"cannot draw '\.jpg'; accepted: \.svg, \.png, \.pdf"), ("none/wall.svg", "there is no folder")],
)
def test_a_file_that_cannot_be_written_is_refused(tmp_path: Path, name: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        draw(load(CONFIGS / "demo.yaml"), tmp_path / name, samples_per_s=1e6)


def test_a_curved_wall_without_an_eye_is_refused_with_its_place(tmp_path: Path) -> None:
    text = (CONFIGS / "cave_corner.yaml").read_text(encoding="utf-8").replace("    eye: [0, -0.25, 1.1]\n", "")
    with pytest.raises(ConfigError, match=r"cave\.yaml:\d+:\d+: views\[0\].*eye's place"):
        draw(loads(text, name="cave.yaml"), tmp_path / "wall.svg", samples_per_s=1e6)
