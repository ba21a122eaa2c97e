"""report.html: one page that holds everything a run found out, with nothing outside it; and its images as files."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from html import escape
from pathlib import Path

from PIL import Image

from wall.study.quality.image_strips import ERROR_GAIN, Bytes, Moment, moments
from wall.study.quality.plots import DARK, LIGHT, all_plots
from wall.study.quality.rows import Row
from wall.study.quality.summary import (
    OURS,
    best_other,
    compare,
    middle,
    scenes,
    spending_text,
)
from wall.study.quality.tables import REQUIRED, tables

JPEG_QUALITY = 92  # of images inside the page; the files beside it are lossless
STYLE = Path(__file__).with_name("report.css")


def write_report(out: Path, rows: Sequence[Row]) -> Path:
    """report.html, plots/*.png and strips/*.png below `out`. `rows` are of one clock and size, at least one."""
    light, dark = all_plots(rows, LIGHT), all_plots(rows, DARK)
    kept = moments(out, rows)
    for folder in ("plots", "strips"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    for name, (_, png) in light.items():
        (out / "plots" / f"{name}.png").write_bytes(png)
    for moment in kept:
        Image.fromarray(moment.strip()).save(out / "strips" / f"{moment.scene}-{moment.time:.2f}s.png")
    plots = [_plot(title, png, dark[name][1]) for name, (title, png) in light.items()]
    first = [table.html() for table in tables(rows) if table.title == REQUIRED]
    others = [table.html() for table in tables(rows) if table.title != REQUIRED]
    body = [
        _head(rows), *first, _images(kept, rows[0].clock), '<h2 id="plots">Plots</h2>', *plots, *others, _about(rows)
    ]  # fmt: skip
    path = out / "report.html"
    path.write_text(_page("".join(body)), encoding="utf-8")
    return path


def _page(body: str) -> str:
    style = STYLE.read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><meta name="color-scheme" '
        f'content="light dark"><title>Speed against error</title><style>{style}</style></head>\n'
        f"<body><main>{body}</main></body></html>\n"
    )


def _head(rows: Sequence[Row]) -> str:
    first, seeds = rows[0], sorted({row.seed for row in rows})
    how = "the same rays a second" if first.clock == "virtual" else "the same CPU time, everything charged"
    about = (
        f"{first.width} &times; {first.height} pixels, {first.refresh_hz:g} Hz, {escape(', '.join(scenes(rows)))}; "
        f"every method had {how}. "
        f"{len(seeds)} seed{'s' if len(seeds) > 1 else ''}. Error is the RMSE of display values (sRGB, 0 to 1) against "
        "the reference image of each refresh's exact time, so that late and coarse count alike."
    )
    tiles = "".join(
        f'<div class="tile"><b>{c.mean:.1f}&times;</b><span>less error than {escape(c.method)}</span></div>'
        for c in [*compare(rows), *best_other(rows)]
        if c.spending == middle(rows) and c.method in ("framed", "framed_x10", "frameless", "best other")
    )
    lead = f"At {spending_text(middle(rows), first.clock)}, geometric mean over scenes" if tiles else ""
    note = f'<p class="note">{lead}</p><div class="tiles">{tiles}</div>'
    return f'<h1>Speed against error</h1><p class="lead">{about}</p>{note}'


def _images(kept: Sequence[Moment], clock: str) -> str:
    if not kept:
        return ""
    parts = [f'<h2>What was shown</h2><p class="note">Below each image its |error| &times; {ERROR_GAIN:g}.</p>']
    for scene in dict.fromkeys(moment.scene for moment in kept):
        here = [moment for moment in kept if moment.scene == scene]
        tabs = "".join(_moment(moment, clock, opened=moment is here[0]) for moment in here)
        parts.append(f"<section><h3>{escape(scene)}</h3>{tabs}</section>")
    return "".join(parts)


def _moment(moment: Moment, clock: str, *, opened: bool) -> str:
    cards = [f"<figure>{_image(moment.reference, 'reference')}<figcaption><b>reference</b></figcaption></figure>"]
    for s in moment.shown:
        ours = ' class="ours"' if s.method == OURS else ""
        cards.append(
            f"<figure{ours}>{_image(s.image, s.method)}{_image(s.error, f'error of {s.method}')}"
            f"<figcaption><b>{escape(s.method)}</b> RMSE {s.rmse:.3f}</figcaption></figure>"
        )
    title = f"{moment.time:.2f} s, {spending_text(moment.spending, clock)}"
    return (
        f"<details{' open' if opened else ''}><summary>{title}</summary>"
        f'<div class="strip">{"".join(cards)}</div></details>'
    )


def _plot(title: str, light: bytes, dark: bytes) -> str:
    return (
        f'<figure class="plot"><figcaption>{escape(title)}</figcaption><picture>'
        f'<source media="(prefers-color-scheme: dark)" srcset="{_data("png", dark)}">'
        f'<img src="{_data("png", light)}" alt="{escape(title)}"></picture></figure>'
    )


def _about(rows: Sequence[Row]) -> str:
    commits = sorted({row.commit for row in rows})
    several = " Rows of several commits stand in one table." if len(commits) > 1 else ""
    machines, commands = ({getattr(row, name) for row in rows} for name in ("machine", "command"))
    return (
        f'<h2>Where this comes from</h2><p class="note">{len(rows)} rows in quality.jsonl. Commit '
        f"{escape(', '.join(commits))}.{several}<br>{escape('; '.join(sorted(machines)))}<br>"
        f"<code>{escape('; '.join(sorted(commands)))}</code></p>"
    )


def _image(image: Bytes, name: str) -> str:
    out = io.BytesIO()
    Image.fromarray(image).save(out, format="JPEG", quality=JPEG_QUALITY, subsampling=0)
    return f'<img src="{_data("jpeg", out.getvalue())}" alt="{escape(name)}" loading="lazy">'


def _data(kind: str, data: bytes) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
