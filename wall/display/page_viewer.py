"""What the page's server knows of a viewer: what it was sent, and what it wants."""

from __future__ import annotations

import asyncio
from collections import defaultdict, deque
from dataclasses import dataclass, field

from aiohttp import web

from wall.core.data import StatisticsImage
from wall.display.base import Choices, Handles, ParameterState
from wall.display.parts import Held

MAX_REQUESTS = 16  # that wait for an answer, or to be sent it; no more is read from the viewer meanwhile

Shown = tuple[bool, int]  # second image of two that are compared, panel


@dataclass(slots=True, eq=False)
class PageViewer:
    """One connection of a page; the server's thread alone uses it."""

    socket: web.WebSocketResponse
    steers: bool = True
    wake: asyncio.Event = field(default_factory=asyncio.Event)
    held: dict[Shown, Held] = field(default_factory=lambda: defaultdict(Held))
    in_flight: deque[int] = field(default_factory=deque)  # numbers of images sent, not yet drawn
    number: int = 0
    layout: str = ""  # as last sent
    choices: Choices | None = None  # as last sent
    told: tuple[object, ...] = ()  # of the status, as last sent
    status_due: float = 0.0
    overlay: str = ""  # one of OVERLAYS
    samples: bool = False  # it makes images itself, of what samples there are
    shows: bool = True  # it wants images, or samples, and status
    requests: asyncio.Semaphore = field(default_factory=lambda: asyncio.Semaphore(MAX_REQUESTS))
    statistics_images: tuple[StatisticsImage, ...] = ()  # as last sent
    parameters: tuple[ParameterState, ...] = ()  # as last sent
    handles: Handles | None = None  # as last sent
