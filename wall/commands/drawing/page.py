"""A page in millimetres, origin top left, with strokes and text; written as SVG, PDF or PNG by matplotlib.

Strokes and text are data until `write_page` draws them, so that a part can be measured before it is placed.
One typeface; sizes are those on paper.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Curve
from matplotlib.textpath import text_to_path
from numpy.typing import ArrayLike

from wall.core.data import Float64
from wall.core.errors import ConfigError
from wall.display.files import replaced

SUFFIXES = (".svg", ".png", ".pdf")
MM_A_POINT = 25.4 / 72
PNG_DPI = 300
BODY_PT, SMALL_PT = 7.0, 6.0  # nothing smaller: it must be read at the printed size
THIN_PT, LINE_PT = 0.4, 0.8  # widths of lines
CAPITALS_EM, DESCENDERS_EM = 0.76, 0.24  # height above and depth below the baseline
EYE_MM = 0.75  # radius of an eye
BLACK, GREY = "#1a1a1a", "#767676"
# DejaVu Sans comes with matplotlib, so a page looks the same on every machine; text of an SVG stays text
_STYLE: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial", "Helvetica"],
    "svg.fonttype": "none",
    "svg.hashsalt": "wall",
    "pdf.fonttype": 42,
    "hatch.linewidth": 0.4,
    "path.simplify": False,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stroke:
    """A line, an area, or both."""

    points: Float64  # (n, 2) mm
    codes: ArrayLike | None = None  # of matplotlib.path; None = straight
    line: str | None = BLACK
    fill: str | None = None
    width: float = THIN_PT  # points
    dashed: bool = False
    hatch: str | None = None
    alpha: float = 1.0
    gid: str | None = None  # id of the element in an SVG
    level: int = 0  # the higher is drawn later


@dataclass(frozen=True, slots=True, kw_only=True)
class TextLine:
    """One line of text."""

    x: float  # mm, at `align`
    y: float  # mm, baseline
    text: str
    size: float = BODY_PT  # points
    bold: bool = False
    colour: str = BLACK
    align: str = "left"  # left, center or right

    def box(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom of its glyphs, mm: from the height of capitals to descenders."""
        width = text_width(self.text, self.size, bold=self.bold)
        left = self.x - {"left": 0.0, "center": width / 2, "right": width}[self.align]
        em = self.size * MM_A_POINT
        return left, self.y - CAPITALS_EM * em, left + width, self.y + DESCENDERS_EM * em


@dataclass(slots=True, kw_only=True, eq=False)
class Page:
    """A page's size, and the strokes and text on it so far."""

    width: float = 0.0  # mm
    height: float = 0.0
    strokes: list[Stroke] = field(default_factory=list)
    texts: list[TextLine] = field(default_factory=list)

    def stroke(self, points: ArrayLike, *, closed: bool = False, **style: Any) -> None:
        """Draw (n, 2) points, mm: a line, or with `closed` an area; `style` holds fields of Stroke."""
        xy = np.asarray(points, dtype=np.float64)
        if closed:
            xy = np.vstack([xy, xy[:1]])
            style["codes"] = (Curve.MOVETO, *(Curve.LINETO,) * (len(xy) - 2), Curve.CLOSEPOLY)
        self.strokes.append(Stroke(points=xy, **style))

    def rect(self, x: float, y: float, width: float, height: float, /, **style: Any) -> None:
        """Draw an upright rectangle; mm."""
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        self.stroke(corners, closed=True, **style)

    def dot(self, x: float, y: float, radius: float, /, **style: Any) -> None:
        """Draw a disc; mm."""
        turn = np.linspace(0, 2 * np.pi, 25)[:-1]
        self.stroke(np.stack([x + radius * np.cos(turn), y + radius * np.sin(turn)], axis=1), closed=True, **style)

    def write(self, x: float, y: float, text: str, **style: Any) -> None:
        """Write one line of text whose baseline is at y; mm; `style` holds fields of TextLine."""
        self.texts.append(TextLine(x=x, y=y, text=text, **style))


@lru_cache(maxsize=65536)
def text_width(text: str, size: float = BODY_PT, *, bold: bool = False) -> float:
    """Width of a line of text, mm."""
    width, _, _ = text_to_path.get_text_width_height_descent(text, _font(size, bold), ismath=False)
    return float(width) * MM_A_POINT


def truncated(text: str, size: float, room: float, *, bold: bool = False) -> str:
    """Text cut with an ellipsis so that it is no wider than `room`, mm."""
    if text_width(text, size, bold=bold) <= room:
        return text
    while len(text) > 1 and text_width(text + "…", size, bold=bold) > room:
        text = text[:-1]
    return text + "…"


@lru_cache(maxsize=64)
def _font(size: float, bold: bool) -> FontProperties:
    """The typeface at a size in points."""
    return FontProperties(family=["DejaVu Sans"], size=size, weight="bold" if bold else "normal")


def check_suffix(path: Path) -> None:
    """Raise ConfigError for a file of another format, or in no folder, before anything is drawn."""
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"-o {path}: cannot draw '{path.suffix}'; accepted: {', '.join(SUFFIXES)}")
    if path.parent != Path() and not path.parent.is_dir():
        raise ConfigError(f"-o {path}: there is no folder {path.parent}")


def write_page(page: Page, path: Path, *, title: str) -> None:
    """Write an SVG, PDF (vectors, at printed size) or PNG (300 dpi); the same page gives the same bytes.

    The file appears whole or not at all.
    """
    check_suffix(path)
    data = rendered(page, path.suffix.lower().removeprefix("."), title=title)
    with replaced(path) as part:
        part.write_bytes(data)


def rendered(page: Page, kind: str, *, title: str) -> bytes:
    """The bytes of an svg, png or pdf."""
    metadata = {
        "svg": {"Title": title, "Date": None, "Creator": "wall"},
        "pdf": {"Title": title, "CreationDate": None, "Creator": "wall"},
        "png": {"Title": title, "Software": "wall"},
    }[kind]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(page.width / 25.4, page.height / 25.4))
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, page.width), ylim=(page.height, 0))
        axes.set_axis_off()
        for order, stroke in enumerate(sorted(page.strokes, key=lambda stroke: stroke.level)):
            axes.add_patch(_patch(stroke, order))
        for words in page.texts:
            axes.text(
                words.x,
                words.y,
                words.text,
                fontsize=words.size,
                fontweight="bold" if words.bold else "normal",
                color=words.colour,
                ha=words.align,
                va="baseline",
                zorder=1e6,
                parse_math=False,
            )
        made = io.BytesIO()
        figure.savefig(made, format=kind, dpi=PNG_DPI, metadata=metadata, facecolor="white")
    return made.getvalue()


def _patch(stroke: Stroke, order: int) -> PathPatch:
    """The matplotlib patch of a stroke; `order`: higher ones are drawn later."""
    return PathPatch(
        Curve(stroke.points, stroke.codes),
        edgecolor=stroke.line or "none",
        facecolor=stroke.fill or "none",
        linewidth=stroke.width if stroke.line else 0.0,
        linestyle=(0, (3, 2)) if stroke.dashed else "solid",
        hatch=stroke.hatch,
        alpha=stroke.alpha if stroke.alpha < 1 else None,
        gid=stroke.gid,
        snap=False if stroke.width < THIN_PT else None,  # to pixels of a PNG: fine lines would be uneven
        zorder=order,
        joinstyle="miter",
        capstyle="butt",
        clip_on=False,
    )
