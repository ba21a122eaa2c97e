"""Where images end: the sinks of one rank, made and fed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from wall.compositing.graph import Step
from wall.config.graph import SinkNode
from wall.config.loading import Loaded
from wall.core.errors import EditError, RunError
from wall.display.base import Answer, Answers, LaysOut, Offers, Sink, Steered
from wall.display.png import PngSink
from wall.display.recorder import Recorder
from wall.display.window import WindowSink
from wall.packets.control import EditAnswer, EditRequest, WindowInput
from wall.packets.json_body import MAX_COMMANDS
from wall.roles.handed_samples import why_images
from wall.roles.node_settings import zoomed_places
from wall.roles.plan import Layout, Plan, window_panels
from wall.run.choices import offer
from wall.run.page_requests import request_of

if TYPE_CHECKING:
    from wall.display.browser import Browser
    from wall.display.gate import Access
    from wall.display.metrics_server import MetricsServer


@dataclass(frozen=True, slots=True)
class PageAt:
    """Where a page is served, or metrics are, and what lets steer it, or watch."""

    address: str
    tokens: tuple[str, str]


def make_sinks(
    plan: Plan, rank: int, out: Path, *, headless: bool, again: bool = False, page: PageAt | None = None
) -> tuple[list[Sink | None], Browser | None]:
    """The sinks of a rank in the order of the graph, and the page among them; None where `headless` leaves one out.

    All windows of a rank are one sink, which stands in the list for each of them. `again`: go on with what the rank
    recorded before; `page`: where it was before. Raises RunError where a display cannot be reached.
    """
    output, layout = plan.layout.config.output, plan.layout
    windows = None if headless else _windows(plan, rank)
    sinks: list[Sink | None] = []
    browser: Browser | None = None
    for step in layout.graph.sinks_on(rank):
        assert isinstance(step.node, SinkNode)
        kind = step.node.kind
        sink: Sink | None = None
        if kind == "png":
            sink = PngSink(_folder(plan, step, out))
        elif kind == "recorder":
            sink = Recorder(_folder(plan, step, out / "recording"), hz=output.record_hz, resume=again)
        elif kind == "window":
            sink = windows
        elif kind == "browser" and not headless:
            from wall.display.browser import Browser  # and aiohttp, 0.2 s, only for walls with a page

            served, port = output.browser, _port(output.browser.port, page)
            access = _access(layout.loaded, page)
            sink = browser = Browser(
                served.host, port, layout.wall, access=access, embed=served.embed, load=served.load
            )  # fmt: skip
            lay_out(plan, [browser])
        sinks.append(sink)
    return sinks, browser


def import_page(plan: Plan) -> None:
    """Load what serves a page, if there is one: a process that is forked from this one has it at once."""
    if any(sink.kind == "browser" for sink in plan.layout.graph.sinks):
        import wall.display.browser  # noqa: F401


def make_metrics_server(plan: Plan, before: PageAt | None = None) -> MetricsServer | None:
    """What serves metrics at a port of their own; None where none is wanted. Raises RunError where that cannot be.

    `before`: where they were before.
    """
    output = plan.layout.config.output
    if output.metrics is None:
        return None
    from wall.display.metrics_server import MetricsServer  # and aiohttp, see above

    port = _port(output.metrics, before)
    return MetricsServer(output.browser.host, port, access=_access(plan.layout.loaded, before))


def _port(port: int, before: PageAt | None) -> int:
    """Where to serve what was served `before`: there again."""
    return port if before is None else urlsplit(before.address).port or port


def _access(loaded: Loaded, before: PageAt | None) -> Access:
    """Who gets in at the page and at metrics. `before`: as there."""
    from wall.display.gate import Access, token_in

    page, folder = loaded.config.output.browser, loaded.folder
    if before is not None:
        steer, watch = before.tokens
    else:
        steer, watch = "", "" if page.watch_token is None else token_in(folder / page.watch_token)
    tls = None if page.tls is None else (folder / page.tls.certificate, folder / page.tls.key)
    return Access(page.tokens, steer, watch, tls)


def check_page(layout: Layout, *, headless: bool = False) -> None:
    """Refuse what a page or metrics could not be served with, before anything is loaded. Raises ConfigError."""
    output, loaded = layout.config.output, layout.loaded
    page, sinks = output.browser, (step.node for step in layout.graph.steps)
    has_page = not headless and any(isinstance(node, SinkNode) and node.kind == "browser" for node in sinks)
    if has_page and output.metrics and output.metrics == page.port:
        accepted = "another port, 0: any free one, or none: the page serves /metrics too"
        raise loaded.error(("output", "metrics"), "is the port of the page", accepted)
    if (not has_page and output.metrics is None) or (page.watch_token is None and page.tls is None):
        return
    from wall.display.gate import tls_of, token_in  # and aiohttp

    key = "watch_token"
    try:
        if page.watch_token is not None:
            token_in(loaded.folder / page.watch_token)
        key = "tls"
        if page.tls is not None:
            tls_of((loaded.folder / page.tls.certificate, loaded.folder / page.tls.key))
    except RunError as error:
        why = str(error).removeprefix(f"output.browser.{key}: ")
        raise loaded.error(("output", "browser", key), why) from error


def _windows(plan: Plan, rank: int) -> WindowSink | None:
    panels = window_panels(plan.layout, (rank,))
    if not panels:
        return None
    windows = WindowSink(panels, refresh_hz=max(view.refresh_hz for view in plan.views))
    lay_out(plan, [windows])
    return windows


def lay_out(plan: Plan, sinks: list[Sink | None]) -> None:
    """Let sinks tell their viewers of this plan's panels and views."""
    for sink in distinct(sinks):
        if isinstance(sink, LaysOut):
            views = [view.id for view in plan.views]
            folder = plan.layout.loaded.folder
            sink.lay_out(plan.layout.wall, views, why_images(plan.layout), zoomed_places(plan.layout), folder)
        if isinstance(sink, Offers):
            offer(sink, plan.layout)


def distinct(sinks: list[Sink | None]) -> list[Sink]:
    """Each sink once."""
    return list({id(sink): sink for sink in sinks if sink is not None}.values())


def save_images(sinks: Sequence[Sink]) -> None:
    """Write the newest image of those that keep one until the end."""
    for sink in sinks:
        if isinstance(sink, PngSink):
            sink.save()


def notes_of(sinks: list[Sink | None]) -> tuple[str, ...]:
    """What a user should know of them, once."""
    return tuple(note for sink in distinct(sinks) if isinstance(sink, WindowSink) for note in sink.notes)


def _folder(plan: Plan, step: Step, folder: Path) -> Path:
    """Where a sink of files writes: the first of its kind to `folder` itself, others to one of their names in it."""
    assert isinstance(step.node, SinkNode)
    first = next(sink for sink in plan.layout.graph.sinks if sink.kind == step.node.kind)
    return folder if first is step.node else folder / step.node.id


def window_input_of(
    rank: int, sinks: list[Sink | None], key: str = ""
) -> Callable[[], list[WindowInput | EditRequest]]:
    """Make a source of messages: what users did at the page and the windows of a rank since it was last asked.

    `key`: the run's, for requests of the page's viewers.
    """
    inputs = [sink for sink in distinct(sinks) if isinstance(sink, Steered)]
    windows = [sink for sink in inputs if isinstance(sink, WindowSink)]
    told = ("", False)  # how the run was ended, as last said

    def ask() -> list[WindowInput | EditRequest]:
        nonlocal told
        commands = [(sink, command) for sink in inputs for command in sink.commands()]
        ended = next((w.escape for w in windows if w.escape), ""), bool(windows) and all(w.gone for w in windows)
        messages = list[WindowInput | EditRequest]()
        for waits, run in groupby(commands, key=lambda each: "id" in each[1]):
            if waits:
                messages += filter(None, (_request(sink, command, key) for sink, command in run))
                continue
            part = [command for _, command in run]
            for k in range(0, len(part), MAX_COMMANDS):
                own = part[k : k + MAX_COMMANDS]
                messages.append(WindowInput(rank=rank, commands=own, escape=ended[0], closed=ended[1]))
        if ended != told and not any(isinstance(message, WindowInput) for message in messages):
            messages.append(WindowInput(rank=rank, escape=ended[0], closed=ended[1]))
        told = ended
        return messages

    return ask


def _request(sink: Sink, message: dict[str, Any], key: str) -> EditRequest | None:
    """The request of a viewer; None for what is none, which the viewer is told."""
    assert isinstance(sink, Answers)
    try:
        return request_of(message, key)
    except EditError as error:
        sink.answer(message["id"], Answer(refused=str(error)))
        return None


def page_answers(sinks: list[Sink | None]) -> Callable[[EditAnswer], None] | None:
    """What tells viewers of the page the manager's answers; None where there is no page."""
    page = next((sink for sink in distinct(sinks) if isinstance(sink, Answers)), None)
    if page is None:
        return None

    def tell(answer: EditAnswer) -> None:
        said = Answer(
            refused=answer.refused, edit=answer.edit, parameters=answer.parameters, left_out=answer.left_out
        )  # fmt: skip
        page.answer(answer.number, said)

    return tell
