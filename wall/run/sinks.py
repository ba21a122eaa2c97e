"""Where images end: the sinks of one rank, made and fed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wall.compositing.graph import Step
from wall.config.graph import SinkNode
from wall.config.loading import Loaded
from wall.display.base import LaysOut, Sink, Steered
from wall.display.png import PngSink
from wall.display.recorder import Recorder
from wall.display.window import WindowSink
from wall.packets.control import WindowInput
from wall.packets.json_body import MAX_COMMANDS
from wall.roles.handed_samples import why_images
from wall.roles.node_settings import zoomed_places
from wall.roles.plan import Plan, window_panels

if TYPE_CHECKING:
    from wall.display.browser import Browser
    from wall.display.metrics_server import MetricsServer


def make_sinks(
    plan: Plan, rank: int, out: Path, *, headless: bool, again: bool = False
) -> tuple[list[Sink | None], Browser | None]:
    """The sinks of a rank in the order of the graph, and the page among them; None where `headless` leaves one out.

    All windows of a rank are one sink, which stands in the list for each of them. `again`: go on with what the rank
    recorded before. Raises RunError where a display
    cannot be reached.
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

            page = output.browser
            access = _access(layout.loaded)
            sink = browser = Browser(page.host, page.port, layout.wall, embed=page.embed, **access)
            lay_out(plan, [browser])
        sinks.append(sink)
    return sinks, browser


def make_metrics_server(plan: Plan) -> MetricsServer | None:
    """What serves metrics at a port of their own; None where none is wanted. Raises RunError where that cannot be."""
    output = plan.layout.config.output
    if output.metrics is None:
        return None
    from wall.display.metrics_server import MetricsServer  # and aiohttp, see above

    return MetricsServer(output.browser.host, output.metrics, **_access(plan.layout.loaded))


def _access(loaded: Loaded) -> dict[str, Any]:
    """Who gets in at the page and at metrics: options of both."""
    from wall.display.gate import token_in

    page, folder = loaded.config.output.browser, loaded.folder
    return {
        "tokens": page.tokens,
        "watch_token": "" if page.watch_token is None else token_in(folder / page.watch_token),
        "tls": None if page.tls is None else (folder / page.tls.certificate, folder / page.tls.key),
    }


def _windows(plan: Plan, rank: int) -> WindowSink | None:
    panels = window_panels(plan.layout, (rank,))
    return WindowSink(panels, refresh_hz=max(view.refresh_hz for view in plan.views)) if panels else None


def lay_out(plan: Plan, sinks: list[Sink | None]) -> None:
    """Let sinks tell their viewers of this plan's panels and views."""
    for sink in sinks:
        if isinstance(sink, LaysOut):
            views = [view.id for view in plan.views]
            sink.lay_out(plan.layout.wall, views, why_images(plan.layout), zoomed_places(plan.layout))


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


def window_input_of(rank: int, sinks: list[Sink | None]) -> Callable[[], list[WindowInput]]:
    """Make a source of messages: what users did at the page and the windows of a rank since it was last asked."""
    inputs = [sink for sink in distinct(sinks) if isinstance(sink, Steered)]
    windows = [sink for sink in inputs if isinstance(sink, WindowSink)]
    told = ("", False)  # how the run was ended, as last said

    def ask() -> list[WindowInput]:
        nonlocal told
        commands = [command for sink in inputs for command in sink.commands()]
        ended = next((w.escape for w in windows if w.escape), ""), bool(windows) and all(w.gone for w in windows)
        if not commands and ended == told:
            return []
        told = ended
        parts = [commands[k : k + MAX_COMMANDS] for k in range(0, len(commands) or 1, MAX_COMMANDS)]
        return [WindowInput(rank=rank, commands=part, escape=ended[0], closed=ended[1]) for part in parts]

    return ask
