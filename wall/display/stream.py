"""Encode what the live page is sent, as bytes and JSON text. Pure, no I/O.

An image is one JSON message `picture` that says how many binary messages follow, of a panel none, one, or two: HEADER,
the numbers of tiles (u16), and these tiles packed into one JPEG or lossless WebP; no numbers: all of the panel. Which
tiles are sent, and how: parts.py, cheapest.py. While two samplers are compared every panel has a second image. A viewer
that makes the images itself gets samples of a panel in the place of tiles: SAMPLES_HEADER, then what encode_samples
gives. An overlay is a binary message for each image of a panel: STATISTICS_HEADER, then codes.
"""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import asdict, replace
from io import BytesIO
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image

from wall.config.displays import ColourConfig
from wall.core.data import StatisticsImage
from wall.display.base import Choices, Handles, PanelImage, ParameterState, Status, WallImage, ZoomedPlace
from wall.display.sample_store import Samples
from wall.display.steering import OVERLAYS
from wall.display.tiles import packed
from wall.geometry.panels import Wall
from wall.operators.lut import Lut

HEADER = struct.Struct("<2sBBHHHHII")  # "WP", format, compared, panel, width, height, tiles, version, image number
STATISTICS_HEADER = struct.Struct("<2sBBHBxHHI")  # "WS", format, compared, panel, overlay, rows, columns, rectangles
SAMPLES_HEADER = struct.Struct("<2sBBHHHxxII")  # "WN", format, 0, panel, width, height, version, image number
TABLE_HEADER = struct.Struct("<I3f3f")  # nodes along an edge, colours of the first and the last node
SAMPLES_COUNTS = struct.Struct("<fBxxxII")  # gain, tone mapping, samples, bytes of their pixels
FORMAT = 4  # of binary messages
QUALITY = 88  # JPEG with full colour: 0.5 ms and 40 kB for 480x270, no visible blocks
MOST_TILES = 65_535  # that one message can number
NO_SAMPLES = "nothing here hands samples on"
MORE = 255  # a byte of a step between pixels after which the step goes on


def encode_jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """(h, w, 3) uint8 sRGB to JPEG; releases the GIL."""
    jpeg: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(rgb), QUALITY, "RGB", "444", True)
    return jpeg


def encode_exactly(rgb: NDArray[np.uint8]) -> bytes:
    """(h, w, 3) uint8 sRGB to lossless WebP: 2 to 3 times the bytes and 6 times the time of a JPEG."""
    out = BytesIO()
    Image.fromarray(rgb).save(out, format="WEBP", lossless=True, quality=0, method=0)
    return out.getvalue()


def encode_tiles(panel: PanelImage, tiles: NDArray[np.bool_], *, exactly: bool) -> bytes:
    """The marked tiles of a panel, as they follow HEADER: their numbers, row by row, and their image.

    tiles : (rows, columns) bool, at least one
    """
    encode = encode_exactly if exactly else encode_jpeg
    if tiles.all() or tiles.size > MOST_TILES:
        return encode(panel.rgb)
    return np.flatnonzero(tiles).astype("<u2").tobytes() + encode(packed(panel.rgb, tiles))


def panel_message(
    index: int, panel: PanelImage, tiles: NDArray[np.bool_], *, encoded: bytes, number: int, compared: bool = False
) -> bytes:
    """Tiles of one panel of image `number`, or of its second one, `encoded` by encode_tiles.

    Counts wrap at 2^32, which takes two years at 60 Hz.
    """
    height, width = panel.rgb.shape[:2]
    count = 0 if tiles.all() or tiles.size > MOST_TILES else int(tiles.sum())
    version = panel.version & 0xFFFFFFFF
    return HEADER.pack(b"WP", FORMAT, compared, index, width, height, count, version, number & 0xFFFFFFFF) + encoded


def encode_samples(samples: Samples, *, whole: bool) -> bytes:
    """Samples as they follow SAMPLES_HEADER: deflated (zlib) SAMPLES_COUNTS, half floats (n, 3), then their pixels.

    Pixels are steps from one to the next in a byte each, the first from -1; 255 is a step of 255 that goes on. Of the
    `whole` panel they are left out. Of 7 bytes a sample 0.7 to 2.8 are left; 1 ms for 6,500 samples, 7 ms for 108,000.
    """
    steps = np.diff(samples.pixels.astype(np.int64), prepend=-1)
    longer = steps // MORE
    ends = np.cumsum(longer + 1) - 1  # where each step's last byte is
    coded = np.full(0 if whole or not len(ends) else int(ends[-1]) + 1, MORE, np.uint8)
    if len(coded):
        coded[ends] = steps - MORE * longer
    counts = SAMPLES_COUNTS.pack(samples.tone.gain, samples.tone.code, len(samples.pixels), len(coded))
    return zlib.compress(counts + samples.light.astype("<u2", copy=False).tobytes() + coded.tobytes(), level=1)


def samples_message(index: int, shape: tuple[int, ...], *, encoded: bytes, version: int, number: int) -> bytes:
    """Samples of a panel of height and width `shape`, `encoded` by encode_samples, as a part of image `number`."""
    height, width = shape
    return (
        SAMPLES_HEADER.pack(b"WN", FORMAT, 0, index, width, height, version & 0xFFFFFFFF, number & 0xFFFFFFFF) + encoded
    )


def image_message(image: WallImage, *, panels: int, number: int) -> str:
    """Announces image `number`, of which `panels` binary messages follow (second images included)."""
    return json.dumps(
        {
            "kind": "picture",
            "number": number,
            "panels": panels,
            "time": image.time,
            "camera_event": image.camera_event,
            "scene_event": image.scene_event,
        }
    )


def statistics_message(statistics_image: StatisticsImage, overlay: str) -> bytes:
    """The codes that an overlay of OVERLAYS draws over a panel: by tile, or n rectangles (4 u16) and their n codes."""
    rows, columns = statistics_image.age.shape
    tiles = overlay == "tiles"
    header = STATISTICS_HEADER.pack(
        b"WS", FORMAT, statistics_image.compared, statistics_image.panel, OVERLAYS.index(overlay), rows, columns,
        len(statistics_image.rects) if tiles else 0,
    )  # fmt: skip
    if tiles:
        return (
            header
            + np.ascontiguousarray(statistics_image.rects, "<u2").tobytes()
            + statistics_image.error_reduction.tobytes()
        )
    return header + (statistics_image.age if overlay == "age" else statistics_image.density).tobytes()


def handles_message(handles: Handles | None) -> str:
    """Where objects that are selected stand; no places: none is."""
    return json.dumps({"kind": "handles", "places": []} | ({} if handles is None else asdict(handles)), allow_nan=False)


WATCHING = json.dumps({"kind": "access", "steers": False})  # to a viewer that may change nothing


def layout_message(
    wall: Wall, views: Sequence[str], why_images: Sequence[str] = (), images: Sequence[ZoomedPlace] = ()
) -> str:
    """Rectangles of panels and insets in virtual screen pixels, and which of `views`, their names, each shows.

    Of panels also what their displays need: metres a pixel, how they are mounted turned, and what is done to colours.
    The first message on every connection. `why_images`: for each panel why it always comes as images, "" if it need
    not; left out: none has samples. `images`: very large ones whose place can be changed.
    """
    why_images = why_images or [NO_SAMPLES] * len(wall.panels)
    panels = [
        {
            "id": p.id,
            "x": p.screen[0],
            "y": p.screen[1],
            "width": p.pixels[0],
            "height": p.pixels[1],
            "across": p.span[0],
            "down": p.span[1],
            "view": p.view,
            "why_images": why_images[p.index],
            "index": p.index,
            "pitch": p.lit_pitch,
            "rotation": p.config.rotation,
            "colour": None if p.config.colour is None else _calibration(p.config.colour),
        }
        for p in wall.panels
    ]
    insets = [
        {"x": p.screen[0], "y": p.screen[1], "width": p.pixels[0], "height": p.pixels[1], "view": p.view}
        for p in wall.insets
    ]
    size = {"width": wall.width, "height": wall.height, "metres": wall.extent}
    others = {"insets": insets, "views": list(views), "images": [asdict(image) for image in images]}
    return json.dumps({"kind": "layout", **size, "panels": panels, **others})


def _calibration(colour: ColourConfig) -> dict[str, Any]:
    """What a panel's display needs done to light; `table`: whether /table/ID has one for display values."""
    return {"gain": colour.gain, "gamma": colour.gamma, "table": colour.lut is not None}


def table_bytes(table: Lut) -> bytes:
    """A 3D table as a page gets it: TABLE_HEADER, then (blue, green, red, 3) float32."""
    header = TABLE_HEADER.pack(len(table.table), *table.low.tolist(), *table.high.tolist())
    return header + np.ascontiguousarray(table.table, "<f4").tobytes()


def choices_message(choices: Choices | None) -> str:
    """What viewers may show instead."""
    names, shown = ((), "") if choices is None else (choices.names, choices.shown)
    return json.dumps({"kind": "choices", "names": names, "shown": shown})


def status_message(status: Status, **more: Any) -> str:
    """Every field of Status but its parameters and totals; what is not finite becomes null, which JSON can say."""
    values = asdict(replace(status, parameters=(), totals=()))
    del values["parameters"], values["totals"]
    return json.dumps(_finite({"kind": "status", **values, **more}), allow_nan=False)


def parameters_message(parameters: tuple[ParameterState, ...]) -> str:
    """Every parameter that can be changed; said when one has changed."""
    return json.dumps({"kind": "parameters", "parameters": [asdict(each) for each in parameters]}, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(v) for name, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
