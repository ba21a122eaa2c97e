"""A viewer of the browser sink that is a script: real sockets, no page."""

from __future__ import annotations

import asyncio
import io
import json
import time

import aiohttp
import numpy as np
from PIL import Image

from wall.display.stream import HEADER
from wall.display.tiles import TILE

PATIENCE_S = 10.0


def run(coroutine):
    return asyncio.run(asyncio.wait_for(coroutine, PATIENCE_S))


class Viewer:
    """What the page does, message by message."""

    def __init__(self, socket):
        self.socket = socket
        self.statuses = []
        self.panels, self.sent_tiles, self.encodings = {}, {}, {}

    async def next_image(self):
        """Number and panels {index: (version, rgb)} of the next image; a second image's index has "compared"."""
        while (message := await self.socket.receive_json())["kind"] != "picture":
            self.statuses.append(message)
        panels, self.sent_tiles, self.encodings = {}, {}, {}
        for _ in range(message["panels"]):
            data = await self.socket.receive_bytes()
            _, _, compared, index, width, height, count, version, number = HEADER.unpack(data[: HEADER.size])
            assert number == message["number"]
            shown = ("compared", index) if compared else index
            tiles = np.frombuffer(data, "<u2", count, HEADER.size).tolist()
            rgb = np.array(Image.open(io.BytesIO(data[HEADER.size + 2 * count :])))
            panels[shown] = (version, self.pasted(shown, rgb, tiles, (height, width)))
            self.sent_tiles[shown] = sorted(self.sent_tiles.get(shown, []) + tiles)
            self.encodings.setdefault(shown, set()).add(data[HEADER.size + 2 * count :][:4])
        return message["number"], panels

    def pasted(self, shown, rgb, tiles, shape):
        """What a panel looks like with these tiles, packed in an image; without any, the image."""
        if not tiles:
            assert rgb.shape == (*shape, 3)
            self.panels[shown] = rgb
            return rgb
        image, across = self.panels.get(shown, np.zeros((*shape, 3), np.uint8)).copy(), rgb.shape[1] // TILE
        for k, tile in enumerate(tiles):
            y, x = (TILE * n for n in divmod(tile, -(-shape[1] // TILE)))
            part = image[y : y + TILE, x : x + TILE]
            top, left = (TILE * n for n in divmod(k, across))
            part[:] = rgb[top : top + part.shape[0], left : left + part.shape[1]]
        self.panels[shown] = image
        return image

    async def drawn(self, number):
        await self.socket.send_json({"kind": "shown", "number": number})

    async def silent_while(self, seconds):
        """Whether only status comes for a while."""
        until = time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            try:
                message = await self.socket.receive(timeout=left)
            except TimeoutError:
                return True
            if isinstance(message.data, bytes) or json.loads(message.data)["kind"] != "status":
                return False
        return True


def with_viewer(browser, act, **options):
    async def session():
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(browser.address + "stream", **options) as ws,
        ):
            return await act(Viewer(ws))

    return run(session())


async def until(condition):
    while not condition():
        await asyncio.sleep(0.005)
