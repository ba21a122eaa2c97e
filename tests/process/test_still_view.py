"""A running wall, steered as by its page: a view that rests after jumps is what `wall render` shows, nothing else."""

from __future__ import annotations

import asyncio
import io
import math
import time
from http import HTTPStatus
from pathlib import Path

import aiohttp
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from running import page_of, start

from wall.commands.render import render
from wall.config.loading import load
from wall.roles.plan import make_layout, make_plan
from wall.study.quality.metrics import display_values

CONFIG = """\
version: 1
scene: {{source: courtyard, animation: []}}
wall: {{grid: {{columns: 1, rows: 1, pixels: [320, 180], size: [0.48, 0.27]}}}}
views: [{{camera: {{position: [7.4, 3.6, 9.4], target: [0, 0.9, 0], fov: 38}}, refresh_hz: 30}}]
sampling: {{method: adaptive, samples_per_pixel: 2}}
graph: {graph}
transport: {{lost_after_s: 30}}
"""
AT_THE_RENDERER = "{preset: sort-first, sinks: [browser]}"
AT_THE_HEAD = """
  nodes:
    - {id: samples, op: samples, panel: r0c0}
    - {id: image, op: reconstruct, input: samples, on: head}
    - {id: page, op: sink, kind: browser, input: image}
"""
REFERENCE_SPP = 64  # its own error is 0.6 codes
ALIKE, GONE = 1.5, 20.0  # RMSE in 8-bit codes
PATIENCE_S = 40.0  # it takes 2 to 4; what stayed of the view before took minutes
WHEEL = math.exp(0.0016 * 400)  # page/steering.js


class Viewer:
    """One viewer of a wall, who holds what it shows against a reference."""

    def __init__(self, session: aiohttp.ClientSession, address: str, reference: NDArray[np.float64]) -> None:
        self._session, self._address, self._reference = session, address, reference

    async def error(self) -> float:
        async with self._session.get(self._address + "wall.png") as answer:
            if answer.status == HTTPStatus.SERVICE_UNAVAILABLE:
                return math.inf  # there is a page before there is an image
            image = Image.open(io.BytesIO(await answer.read())).convert("RGB")
        return float(np.sqrt(((np.asarray(image) - self._reference) ** 2).mean()))

    async def until(self, least: float, most: float, what: str) -> None:
        """Wait until the error lies between."""
        deadline, error = time.monotonic() + PATIENCE_S, math.inf
        while not least <= error <= most:
            assert time.monotonic() < deadline, f"{what}: {error:.2f} codes RMSE after {PATIENCE_S} s"
            await asyncio.sleep(0.1)
            error = await self.error()


async def listen(page: aiohttp.ClientWebSocketResponse) -> None:
    """Read all that comes: pings are answered as they are read, and a viewer that answers none is taken for gone."""
    async for _ in page:
        pass


async def zoom_and_return(address: str, reference: NDArray[np.float64]) -> None:
    async with aiohttp.ClientSession() as session, session.ws_connect(address + "stream") as page:
        viewer, listening = Viewer(session, address, reference), asyncio.create_task(listen(page))
        await viewer.until(0.0, ALIKE, "at first")
        for _ in range(3):
            await page.send_json({"kind": "zoom", "x": WHEEL})
        await viewer.until(GONE, math.inf, "zoomed")
        await asyncio.sleep(3.0)  # plain surfaces of the zoomed view are complete
        await page.send_json({"kind": "reset"})
        await viewer.until(0.0, ALIKE, "back")
        listening.cancel()


def written(folder: Path, graph: str) -> Path:
    config = folder / "wall.yaml"
    config.write_text(CONFIG.format(graph=graph), encoding="utf-8")
    return config


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> NDArray[np.float64]:
    config = written(tmp_path_factory.mktemp("reference"), AT_THE_RENDERER)
    converged = render(make_plan(make_layout(load(config))), spp=REFERENCE_SPP, seed=7, at=0.0)
    assert converged is not None
    return 255.0 * display_values(converged)


@pytest.mark.clock
@pytest.mark.parametrize("graph", [AT_THE_RENDERER, AT_THE_HEAD], ids=["at the renderer", "at the head"])
def test_after_a_zoom_and_a_reset_nothing_of_the_zoomed_view_stays(
    tmp_path: Path, graph: str, reference: NDArray[np.float64]
) -> None:
    config = written(tmp_path, graph)
    run = start("run", config, "--still", "--out", tmp_path / "out", "--seconds", 170)
    try:
        asyncio.run(zoom_and_return(page_of(run), reference))
    finally:
        run.terminate()
        run.wait(20)
