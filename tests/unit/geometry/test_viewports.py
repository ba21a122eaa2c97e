"""Several views on one wall: who shows what, where insets lie, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wall.config.loading import loads
from wall.core.data import Rect
from wall.core.errors import ConfigError
from wall.geometry.panels import NO_VIEW, Wall
from wall.geometry.viewports import edges_of, panel_rect
from wall.operators.outline import Outline
from wall.roles.plan import make_layout

TEXT = """\
version: 1
scene: {{source: courtyard}}
wall: {{grid: {{columns: 2, rows: 1, pixels: [40, 30], size: [0.4, 0.3], bezel: 0.02}}}}
views:
{views}
"""  # with 4 pixels between them: 84x30
MAIN = "  - {id: main}\n"


def wall_of(views: str) -> Wall:
    return make_layout(loads(TEXT.format(views=views), path=Path("a.yaml"))).wall


def places(wall: Wall) -> dict[str, tuple[int, Rect]]:
    return {viewport.id: (viewport.view, panel_rect(viewport)) for viewport in wall.viewports}


def test_a_view_without_a_place_fills_the_wall() -> None:
    wall = wall_of(MAIN)
    assert (wall.insets, [panel.view for panel in wall.panels]) == ((), [0, 0])


def test_a_view_may_have_panels_of_its_own() -> None:
    wall = wall_of(MAIN + "  - {id: map, panels: [r0c1]}\n")
    assert (wall.insets, [panel.view for panel in wall.panels]) == ((), [0, 1])
    assert [panel.id for panel in wall.of_view(1).panels] == ["r0c1"]


def test_an_inset_goes_across_the_bezel_and_lies_in_its_panels_planes() -> None:
    """A quarter of the width to three quarters: 21 to 63, of which 40 to 44 are bezel."""
    wall = wall_of(MAIN + "  - {id: map, viewport: {left: 0.25, top: 0.1, width: 0.5, height: 0.4}}\n")
    assert places(wall) == {
        "r0c0": (0, Rect(x=0, y=0, width=40, height=30)),
        "r0c1": (0, Rect(x=44, y=0, width=40, height=30)),
        "r0c0.map": (1, Rect(x=21, y=3, width=19, height=12)),
        "r0c1.map": (1, Rect(x=44, y=3, width=19, height=12)),
    }
    assert [viewport.index for viewport in wall.viewports] == [0, 1, 2, 3]
    assert [inset.inset_of for inset in wall.insets] == [0, 1]
    assert all(inset.plane is wall.panels[0].plane for inset in wall.insets)
    both = wall.of_view(1)
    np.testing.assert_allclose(both.outline[:, 0], [-0.21, 0.21, -0.21], atol=1e-12)  # metres, 0.01 a pixel
    np.testing.assert_allclose(both.outline[:, 1], [0.0, 0.0, 0.12], atol=1e-12)


def test_edges_of_a_viewport_lie_where_it_ends_and_not_along_bezels() -> None:
    text = MAIN + "  - {id: map, viewport: {left: 0.25, top: 0.1, width: 0.5, height: 0.4}, border: {}}\n"
    loaded = loads(TEXT.format(views=text), path=Path("a.yaml"))
    layout = make_layout(loaded)
    wall, view = layout.wall, loaded.config.views[1]
    assert [edges_of(inset, view, wall) for inset in wall.insets] == [
        ("left", "top", "bottom"),
        ("top", "right", "bottom"),
    ]
    assert edges_of(wall.panels[0], loaded.config.views[0], wall) == ()
    outlines = [step.node for step in layout.graph.steps if isinstance(step.node, Outline)]
    assert [(node.id, node.input, node.sides) for node in outlines] == [
        ("p2", "inside-p2", ("left", "top", "bottom")),
        ("p3", "inside-p3", ("top", "right", "bottom")),
    ]


def test_later_views_lie_over_earlier_ones_and_one_that_covers_a_panel_whole_is_the_panels() -> None:
    text = (
        MAIN
        + "  - {id: whole, viewport: {left: 0, top: 0, width: 0.5, height: 1}}\n"
        + "  - {id: small, viewport: {left: 0, top: 0, width: 0.1, height: 0.1}}\n"
    )
    wall = wall_of(text)
    assert [panel.view for panel in wall.panels] == [1, 0]
    assert [(inset.id, inset.view) for inset in wall.insets] == [("r0c0.small", 2)]


def test_viewports_may_cover_a_panel_together() -> None:
    quarters = [(0, 0), (0.5, 0), (0, 0.5), (0.5, 0.5)]
    places = (f"viewport: {{left: {x}, top: {y}, width: 0.5, height: 0.5}}" for x, y in quarters)
    wall = wall_of("".join(f"  - {{id: v{k}, {place}}}\n" for k, place in enumerate(places)))
    assert [panel.view for panel in wall.panels] == [NO_VIEW, NO_VIEW]
    assert [(inset.inset_of, inset.view, inset.pixels) for inset in wall.insets] == [
        (0, 0, (40, 15)), (0, 2, (40, 15)), (1, 1, (40, 15)), (1, 3, (40, 15)),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("views", "expected"),
    [
        (MAIN + "  - {id: map, panels: [r0c2]}\n", "there is no panel r0c2; accepted: r0c0"),
        (MAIN + "  - {id: map}\n", "5:5: views[0]: nobody sees any of it"),
        ("  - {id: main, panels: [r0c0]}\n", "5:5: views[0]: no view fills panel r0c1; accepted: neither panels nor"),
        (
            MAIN + "  - {id: map, panels: [r0c0], viewport: {left: 0, top: 0, width: 0.5, height: 1}}\n",
            "views[1].viewport: it has panels already; accepted: one of panels, viewport",
        ),
        (
            MAIN + "  - {id: map, viewport: {left: 0.8, top: 0, width: 0.5, height: 1}}\n",
            "views[1].viewport.width = 0.5: does not lie on the wall; accepted: above 0, up to 0.2",
        ),
        (
            MAIN + "  - {id: map, viewport: {left: 0.477, top: 0, width: 0.04, height: 1}}\n",
            "views[1]: nobody sees any of it",
        ),
        (
            MAIN + "  - {id: map, panels: [r0c1], camera: {follow: mian}}\n",
            "views[1].camera.follow = 'mian': is no view before this one; accepted: main",
        ),
        (MAIN + "  - {id: map, panels: [r0c1], border: {}}\n", "views[1].border: it has no viewport to go around"),
        ("  - {id: a, camera: {follow: a}}\n", "views[0].camera.follow = 'a': is no view before this one"),
        (
            MAIN + "  - {id: map, panels: [r0c1], camera: {follow: main}, path: {type: orbit}}\n",
            "views[1].path: its camera follows another view's",
        ),
        (
            MAIN + "  - {id: map, panels: [r0c1], camera: {follow: main, name: x}}\n",
            "views[1].camera: says more than once where the eye is",
        ),
    ],
)  # fmt: skip
def test_views_that_cannot_be_are_refused_with_their_place(views: str, expected: str) -> None:
    with pytest.raises(ConfigError) as refused:
        wall_of(views)
    assert expected in str(refused.value)
