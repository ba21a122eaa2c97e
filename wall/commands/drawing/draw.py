"""`wall draw`: the wall to scale beside its compositing graph, on one page of its own size."""

from __future__ import annotations

from pathlib import Path

from wall.commands.drawing.diagram import diagram_of
from wall.commands.drawing.graph_part import graph_part
from wall.commands.drawing.legend import Legend
from wall.commands.drawing.merging import merged
from wall.commands.drawing.model import Diagram
from wall.commands.drawing.page import Page, check_suffix, write_page
from wall.commands.drawing.palette import process_colours
from wall.commands.drawing.wall_part import wall_part
from wall.config.loading import Loaded
from wall.roles.plan import make_layout

MARGIN_MM = 3.0
BETWEEN_MM = 8.0  # wall and graph
HEADING_MM = 4.2
WALL_MM = (54.0, 92.0)  # width of the wall's part: least, most
WALL_HEIGHT_MM = (80.0, 120.0)
SIDE_BY_SIDE_MM = 140.0  # below it the graph stands under the wall
NEARLY = 1.1  # times the wanted width: below it boxes are not made narrower and higher
TEXT_WIDTH_MM = 178.0  # two columns of a journal


def draw(loaded: Loaded, path: Path, *, samples_per_s: float, width: float = TEXT_WIDTH_MM) -> Page:
    """Write the drawing of a configuration, and return its page. `width`: mm to aim at; see `compose`.

    Raises ConfigError for what `wall check` refuses before it loads the scene, and for a file it cannot write.
    """
    check_suffix(path)
    shown = diagram_of(make_layout(loaded), samples_per_s=samples_per_s)
    page = compose(shown, width=width)
    write_page(page, path, title=shown.name)
    return page


def compose(shown: Diagram, *, width: float = TEXT_WIDTH_MM) -> Page:
    """The page of a diagram: wall and graph side by side, or the graph below on less than SIDE_BY_SIDE_MM.

    Type keeps its printed size, so a graph that needs more than `width` makes the page wider.
    """
    together = merged(shown)
    used = {box.process for box in together.boxes}
    colours = process_colours({key: process for key, process in together.processes.items() if key in used})
    beside = width >= SIDE_BY_SIDE_MM
    room, (least, most) = width - 2 * MARGIN_MM, WALL_MM
    graph = graph_part(together, colours)
    if graph.width > NEARLY * room - (least + BETWEEN_MM if beside else 0.0):
        graph = graph_part(together, colours, narrow=True)
    wall_width = min(max(room - BETWEEN_MM - graph.width, least), most) if beside else max(room, graph.width)
    wall_height = min(max(graph.height + HEADING_MM, WALL_HEIGHT_MM[0]), WALL_HEIGHT_MM[1]) if beside else most
    wall = wall_part(together, colours, width=wall_width, height=wall_height)
    left = wall_width + BETWEEN_MM if beside else 0.0
    top = 0.0 if beside else wall.height + BETWEEN_MM
    page = Page(width=2 * MARGIN_MM + max(wall_width, left + graph.width))
    wall.draw(page, MARGIN_MM, MARGIN_MM)
    page.write(MARGIN_MM + left, MARGIN_MM + top + 2.4, "Compositing graph", bold=True)
    slack = max(0.0, wall.height - HEADING_MM - graph.height) / 2 if beside else 0.0
    graph.draw(page, MARGIN_MM + left, MARGIN_MM + top + HEADING_MM + slack)
    bottom = max(wall.height, top + HEADING_MM + graph.height)
    legend = Legend(together, colours, overlaps=any(stroke.gid == "overlap" for stroke in page.strokes))
    end = legend.draw(page, MARGIN_MM, MARGIN_MM + bottom + 5.0, page.width - 2 * MARGIN_MM)
    page.height = end + MARGIN_MM
    return page
