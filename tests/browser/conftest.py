"""A real headless Chromium, and a wall whose image follows the commands that arrive."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from wall.config.sampling import METHODS
from wall.config.screens import GridConfig, WallConfig
from wall.core.data import StatisticsImage
from wall.display.base import Handles, PanelImage, ParameterState, RankStatus, Status, WallImage
from wall.display.browser import Browser
from wall.display.gate import Access
from wall.geometry.expanding import expand
from wall.geometry.panels import Wall

REFRESH_S = 1 / 30
SECOND = (20, 40, 220)  # colour of every second image
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


def find_chromium() -> str | None:
    """Path of an installed Chromium or Chrome, or None."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")  # while Playwright runs, asyncio.run cannot be used in this thread
def chromium() -> Iterator[Any]:
    path = find_chromium()
    if path is None:
        pytest.skip("no chromium, chromium-browser or google-chrome on PATH: the page is not tested")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@dataclass
class Source(threading.Thread):
    """Shows a flat colour a panel at 30 Hz; what the page asks for changes colour, sampler and pause.

    Panel k has red 40 + 50 k; the sum of orbits moves green by 100 a wall height; blue counts nothing and is 30. Second
    images, while something is compared, are blue. Statistics images: see `statistics_images`.
    """

    wall: Wall
    port: int = 0
    received: list[dict[str, Any]] = field(default_factory=list)
    lost_rank: bool = False
    busy_rank: bool = False
    views: tuple[str, ...] = ("main",)
    tokens: bool = False
    offered: tuple[ParameterState, ...] = ()
    handles: Handles | None = None  # of what is selected
    selected: tuple[str, ...] = ("urn",)  # by view
    values: dict[str, tuple[float, ...] | None] = field(default_factory=dict)  # None: as configured
    __hash__ = threading.Thread.__hash__

    def __post_init__(self) -> None:
        super().__init__(daemon=True)
        self.sink = Browser("127.0.0.1", self.port, self.wall, views=self.views, access=Access(self.tokens))
        self.turned, self.paused, self.sampler, self.compare, self.statistics = 0.0, False, "hilbert", "", ""
        self.version = self.refreshes = 0
        self.bookmarks: tuple[int, ...] = ()
        self.stopping = threading.Event()
        self.start()

    def run(self) -> None:
        while not self.stopping.wait(REFRESH_S):
            for command in self.sink.commands():
                self.obey(command)
            self.refreshes += 1
            self.sink.show(self.image(), self.status())

    def obey(self, command: dict[str, Any]) -> None:
        self.received.append(command)
        self.version += 1
        if command["kind"] == "orbit":
            self.turned += command["x"]
        elif command["kind"] == "pause":
            self.paused = not self.paused
        elif command["kind"] == "sampler":
            self.sampler, self.compare = command["value"], ""
        elif command["kind"] == "compare":
            self.compare = command["value"]
        elif command["kind"] == "bookmark":
            self.bookmarks = (*self.bookmarks, int(command["value"]))
        elif command["kind"] == "statistics":
            self.statistics = command["value"]
        elif command["kind"] == "set":
            self.values[command["name"]] = command["numbers"] and tuple(command["numbers"])

    def green(self) -> int:
        return int(np.clip(100 + 100 * self.turned, 0, 255))

    def image(self) -> WallImage:
        panels = self.panels(lambda k: (40 + 50 * k, self.green(), 30))
        return WallImage(
            width=self.wall.width, height=self.wall.height, panels=panels, time=self.refreshes * REFRESH_S,
            camera_event=self.version, scene_event=0,
            compared=self.panels(lambda k: SECOND) if self.compare else (), statistics_images=self.statistics_images(),
            handles=self.handles,
        )  # fmt: skip

    def panels(self, colour: Callable[[int], tuple[int, int, int]]) -> tuple[PanelImage, ...]:
        return tuple(
            PanelImage(
                id=p.id, screen=p.screen, version=self.version,
                rgb=np.full((p.pixels[1], p.pixels[0], 3), colour(p.index), np.uint8),
            )
            for p in self.wall.panels
        )  # fmt: skip

    def statistics_images(self) -> tuple[StatisticsImage, ...]:
        """8 x 5 tiles a panel: ages grow from left to right, nothing is in the first column. Two rectangles."""
        if not self.statistics:
            return ()
        codes = np.tile(np.arange(8, dtype=np.uint8) * 36, (5, 1))
        rects = np.array([[0, 0, 60, 68], [60, 0, 60, 68]], np.uint16)
        return tuple(
            StatisticsImage(
                panel=p.index, compared=second, age=codes, density=codes[:, ::-1], rects=rects,
                error_reduction=np.array([60, 200], np.uint8),
            )
            for p in self.wall.panels for second in ((False, True) if self.compare else (False,))
        )  # fmt: skip

    @property
    def stale(self) -> tuple[tuple[float, float, float, float], ...]:
        """The left half of the second panel."""
        (x, y), (width, height) = self.wall.panels[1].screen, self.wall.panels[1].pixels
        return ((x, y, width / 2, height),)

    def status(self) -> Status:
        ranks = tuple(
            RankStatus(
                rank=k + 1,
                role="renderer",
                panel=p.id,
                region=p.id,
                samples_per_s=1.25e6,
                bytes_per_s=9.5e6,
                oldest_sample_s=0.2,
                dropped=3 * k,
                alive=not (self.lost_rank and k == 1),
                memory_mb=150.0,
                busy_s=4.0 * (self.busy_rank and k == 1),
            )
            for k, p in enumerate(self.wall.panels)
        )
        return Status(
            seconds=self.refreshes * REFRESH_S,
            paused=self.paused,
            parameters=tuple(replace(p, value=self.values.get(p.name) or p.default) for p in self.offered),
            sampler="adaptive" if self.compare else self.sampler,
            samplers=METHODS,
            ranks=ranks,
            latency_ms=(21.0, 34.0, 55.0),
            latencies_ms=(20.0, 22.0, 34.0),
            refreshes_per_s=30.0,
            compare=self.compare,
            compared_per_s=2e6 if self.compare else 0.0,
            bookmarks=self.bookmarks,
            selected=self.selected,
            right_ms=420.0,
            stale=self.stale if self.lost_rank else (),
            slow="Rank 2 (r0c1) makes 3 of 30 images a second." if self.lost_rank else "",
            notes=("rank 2: no GPU", "rank 1: <b>died</b>") if self.lost_rank else (),
            view_samplers=(self.sampler, *(METHODS[0] for _ in self.views[1:])),
        )

    def stop(self) -> None:
        self.stopping.set()
        self.join()
        self.sink.close()


@pytest.fixture
def grid() -> Wall:
    """2 x 2 panels of 120 x 68 pixels with bezels."""
    sizes = {"pixels": (120, 68), "size": (0.12, 0.068), "bezel": 0.003}
    return expand(WallConfig(grid=GridConfig(columns=2, rows=2, **sizes)))


@pytest.fixture
def views() -> tuple[str, ...]:
    return ("main",)


@pytest.fixture
def source(grid: Wall, views: tuple[str, ...]) -> Iterator[Source]:
    source = Source(grid, views=views)
    yield source
    source.stop()


@pytest.fixture
def source_with_tokens(grid: Wall) -> Iterator[Source]:
    source = Source(grid, tokens=True)
    yield source
    source.stop()


@pytest.fixture
def page(chromium: Any, source: Source) -> Iterator[Any]:
    """The page on `source`, its first image drawn. Fails the test when the page complained."""
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    page = context.new_page()
    page.set_default_timeout(15_000)
    page.complaints = []
    page.on("console", lambda m: m.type in ("error", "warning") and page.complaints.append(m.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(source.sink.address)
    for _ in range(1000):
        if page.evaluate("Boolean(document.body.dataset.picture && document.body.dataset.state)"):
            break
        page.wait_for_timeout(10)
    else:
        pytest.fail("the page drew no picture")
    yield page
    context.close()
    assert page.complaints == []
