"""What `wall measure accuracy` writes: rows, a table, a page with pictures, and the guide's part about hard cases."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from PIL import Image
from rich.table import Table
from rich.text import Text

from wall.core.errors import ConfigError
from wall.study import json_lines
from wall.study.accuracy.case import Case, Picture
from wall.study.accuracy.cases import case_named
from wall.study.accuracy.rows import Row

STYLE = Path(__file__).parent.parent / "quality" / "report.css"
BEGIN, END = "<!-- hard cases: begin -->", "<!-- hard cases: end -->"  # around what `guide` writes
OWN_STYLE = ".strip figure { max-width: 370px } .strip img { image-rendering: pixelated }"
COLUMNS = "| case | what is done | figure | bound | reason for the bound |"


def table(rows: Sequence[Row]) -> Table:
    """For the terminal."""
    made = Table(title="hard cases")
    for name in ("case", "figure", "bound", "unit", "inside"):
        made.add_column(name, justify="right" if name in ("figure", "bound") else "left")
    for row in rows:
        made.add_row(
            row.case, number(row.figure), number(row.bound), row.unit, Text("yes") if row.ok else Text("no", "red")
        )
    return made


def number(value: float) -> str:
    """Three digits, whole numbers as such; what has no end, or is not a number, in words."""
    if not math.isfinite(value):
        return "without end" if value > 0.0 else "not a number"
    return f"{value:,.0f}" if value == int(value) and abs(value) < 1e9 else f"{value:.3g}"


def write(out: Path, rows: Sequence[Row], pictures: Mapping[str, Sequence[Picture]]) -> Path:
    """Writes accuracy.jsonl, accuracy.md, pictures/*.png and report.html into `out`; returns the last."""
    (out / "pictures").mkdir(parents=True, exist_ok=True)
    lines = "".join(json_lines.line_of(row) + "\n" for row in rows)
    (out / "accuracy.jsonl").write_text(lines, encoding="utf-8")
    (out / "accuracy.md").write_text(markdown(rows), encoding="utf-8")
    for name, images in pictures.items():
        for k, image in enumerate(images):
            _enlarged(image).save(out / "pictures" / f"{name}-{k}.png")
    path = out / "report.html"
    path.write_text(_page(rows, pictures), encoding="utf-8")
    return path


def _figure(row: Row) -> str:
    return f"{number(row.figure)} {row.unit}" if math.isfinite(row.figure) else number(row.figure)


def markdown(rows: Sequence[Row]) -> str:
    """The rows as tables, a heading for each family."""
    parts = []
    for family in dict.fromkeys(case_named(row.case).family for row in rows):
        parts.append(
            f"### {family}\n\n| case | what is done | figure | bound | reason for the bound |\n|---|---|---|---|---|\n"
        )
        for row in rows:
            case = case_named(row.case)
            if case.family == family:
                figure = _figure(row) + ("" if row.ok else " **outside**")
                parts.append(f"| `{row.case}` | {case.scene} | {figure} | {number(row.bound)} | {case.reason} |\n")
        parts.append("\n")
    return "".join(parts).rstrip() + "\n"


def guide(page: Path, rows: Sequence[Row]) -> None:
    """Replaces what stands between BEGIN and END in a page by these rows. Raises ConfigError where they are not."""
    text = page.read_text(encoding="utf-8")
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise ConfigError(f"{page}: wanted one line '{BEGIN}' and one line '{END}' behind it")
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    page.write_text(f"{before}{BEGIN}\n\n{markdown(rows)}\n{after}", encoding="utf-8")


def _page(rows: Sequence[Row], pictures: Mapping[str, Sequence[Picture]]) -> str:
    outside = [row.case for row in rows if not row.ok]
    lead = f"{len(rows)} cases, {len(rows) - len(outside)} inside their bounds, {sum(r.seconds for r in rows):.0f} s."
    said = f'<p class="missed">Outside: {escape(", ".join(outside))}</p>' if outside else ""
    families = dict.fromkeys(case_named(row.case).family for row in rows)
    style = STYLE.read_text(encoding="utf-8") + OWN_STYLE
    lines = "".join(_line(row) for row in rows)
    head = "<tr><th class=text>case<th class=number>figure<th class=number>bound<th class=text>unit<th class=text></tr>"
    summary = f'<div class="wide"><table>{head}{lines}</table></div>'
    body = summary + "".join(_family(family, rows, pictures) for family in families)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" '
        f'content="light dark"><title>Hard cases</title><style>{style}</style></head>\n'
        f'<body><main><h1>Hard cases</h1><p class="lead">{lead}</p>{said}{body}</main></body></html>\n'
    )


def _line(row: Row) -> str:
    return (
        f'<tr><td class="text"><a href="#{row.case}">{row.case}</a><td class="number">{number(row.figure)}'
        f'<td class="number">{number(row.bound)}<td class="text">{escape(row.unit)}<td class="text">{_inside(row)}</tr>'
    )


def _inside(row: Row) -> str:
    return '<span class="met">inside</span>' if row.ok else '<span class="missed">outside</span>'


def _family(family: str, rows: Sequence[Row], pictures: Mapping[str, Sequence[Picture]]) -> str:
    parts = [f"<h2>{escape(family)}</h2>"]
    for row in rows:
        case = case_named(row.case)
        if case.family == family:
            parts.append(_case(row, case, pictures.get(row.case, ())))
    return "".join(parts)


def _case(row: Row, case: Case, pictures: Sequence[Picture]) -> str:
    cards = "".join(
        f'<figure><img src="pictures/{row.case}-{k}.png" alt="{escape(image.title)}" loading="lazy">'
        f"<figcaption>{escape(image.title)}</figcaption></figure>"
        for k, image in enumerate(pictures)
    )
    found = f" Found: {escape(row.note)}." if row.note else ""
    return (
        f'<h3 id="{row.case}">{row.case}: {escape(_figure(row))}, bound {number(row.bound)}, '
        f"{_inside(row)}</h3><p>{escape(case.scene)}.</p>"
        f'<p class="note">Bound: {escape(case.reason)}.{found}</p>'
        + (f'<div class="strip">{cards}</div>' if cards else "")
    )


def _enlarged(image: Picture) -> Image.Image:
    """Small pictures by whole pixels, so that a browser does not blur them."""
    height, width = image.rgb.shape[:2]
    times = max(1, 256 // max(height, width))
    return Image.fromarray(image.rgb).resize((width * times, height * times), Image.Resampling.NEAREST)
