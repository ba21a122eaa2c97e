"""Where pictures end: the sinks of one rank, made and fed."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path

from wall.compositing.graph import Step
from wall.config.schema import SinkNode
from wall.core.data import Event, StatisticsImage
from wall.display.base import Sink, Status, WallPicture
from wall.display.browser import Browser
from wall.display.png import PngSink
from wall.display.recorder import Recorder
from wall.display.window import WindowSink
from wall.geometry.panels import Panel
from wall.roles.plan import Layout, Plan
from wall.roles.present import Shown

STILL = Status(
    seconds=0.0, paused=False, sampler="", samplers=(), ranks=(), latency_ms=(0.0, 0.0, 0.0), latencies_ms=(),
    refresh_hz=0.0,
)  # fmt: skip  # what sinks away from the head are told: they show none of it


def make_sinks(plan: Plan, rank: int, out: Path, *, headless: bool) -> tuple[list[Sink | None], Browser | None]:
    """The sinks of a rank in the order of the graph, and the page among them; None where `headless` leaves one out.

    All windows of a rank are one sink, which stands in the list for each of them. Raises RunError where a display
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
            sink = Recorder(_folder(plan, step, out / "recording"), hz=output.record_hz)
        elif kind == "window":
            sink = windows
        elif kind == "browser" and not headless:
            sink = browser = Browser(output.browser.host, output.browser.port, layout.wall)
        sinks.append(sink)
    return sinks, browser


def window_panels(layout: Layout, ranks: Container[int]) -> list[Panel]:
    """The panels that have a window on some ranks."""
    return [
        layout.wall.panels[k]
        for step in layout.graph.steps
        if step.rank in ranks and isinstance(step.node, SinkNode) and step.node.kind == "window"
        for k in step.panels
    ]


def window_ranks(layout: Layout) -> frozenset[int]:
    """The ranks that have windows, unless the run is headless."""
    return frozenset(rank for rank in range(layout.graph.compositors) if window_panels(layout, (rank,)))


def window_sink(sinks: list[Sink | None]) -> WindowSink | None:
    """The one of all windows of a rank."""
    return next((sink for sink in sinks if isinstance(sink, WindowSink)), None)


def _windows(plan: Plan, rank: int) -> WindowSink | None:
    panels = window_panels(plan.layout, (rank,))
    return WindowSink(panels, refresh_hz=plan.view.refresh_hz) if panels else None


def distinct(sinks: list[Sink | None]) -> list[Sink]:
    """Each sink once."""
    return list({id(sink): sink for sink in sinks if sink is not None}.values())


def notes_of(sinks: list[Sink | None]) -> tuple[str, ...]:
    """What a user should know of them, once."""
    return tuple(note for sink in distinct(sinks) if isinstance(sink, WindowSink) for note in sink.notes)


def _folder(plan: Plan, step: Step, folder: Path) -> Path:
    """Where a sink of files writes: the first of its kind to `folder` itself, others to one of their names in it."""
    assert isinstance(step.node, SinkNode)
    first = next(sink for sink in plan.layout.graph.sinks if sink.kind == step.node.kind)
    return folder if first is step.node else folder / step.node.id


def show_all(
    plan: Plan,
    sinks: list[Sink | None],
    shown: list[Shown],
    event: Event,
    now: float,
    *,
    status: Status = STILL,
    compared: list[Shown] | None = None,
    statistics_images: tuple[StatisticsImage, ...] = (),
) -> None:
    """Hand every sink its newest picture."""
    for k, (sink, pictures) in enumerate(zip(sinks, shown, strict=True)):
        if sink is None:
            continue
        width, height = pictures.size
        picture = WallPicture(
            width=width,
            height=height,
            panels=pictures.pictures(),
            time=now,
            camera_event=event.camera_event,
            scene_event=event.scene_event,
            compared=compared[k].pictures() if compared else (),
            statistics_images=statistics_images,
        )
        sink.show(picture, status)
