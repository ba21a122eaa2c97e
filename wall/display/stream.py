"""Encode what the live page is sent, as bytes and JSON text. Pure, no I/O.

An image is one JSON message `image` that says how many panels follow, then one binary message a panel:
HEADER, then a JPEG. Only panels that changed since the viewer's last image are sent. While two samplers are compared
every panel has a second image. An overlay is a binary message for each image of a panel: STATISTICS_HEADER, then
codes.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import simplejpeg

from wall.core.data import StatisticsImage
from wall.display.base import PanelImage, ParameterState, Status, WallImage
from wall.display.steering import OVERLAYS
from wall.geometry.panels import Wall

HEADER = struct.Struct("<2sBBHHHxxII")  # "WP", format, compared, panel, width, height, version, image number
STATISTICS_HEADER = struct.Struct("<2sBBHBxHHI")  # "WS", format, compared, panel, overlay, rows, columns, rectangles
FORMAT = 2
QUALITY = 88  # JPEG with full colour: 0.5 ms and 40 kB for 480x270, no visible blocks


def encode_jpeg(panel: PanelImage) -> bytes:
    """(h, w, 3) uint8 sRGB to JPEG; releases the GIL."""
    jpeg: bytes = simplejpeg.encode_jpeg(panel.rgb, QUALITY, "RGB", "444", True)
    return jpeg


def panel_message(index: int, panel: PanelImage, *, jpeg: bytes, number: int, compared: bool = False) -> bytes:
    """One panel of image `number`, or its second one. Counts wrap at 2^32, which takes two years at 60 Hz."""
    height, width = panel.rgb.shape[:2]
    header = HEADER.pack(b"WP", FORMAT, compared, index, width, height, panel.version & 0xFFFFFFFF, number & 0xFFFFFFFF)
    return header + jpeg


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


def layout_message(wall: Wall, views: Sequence[str]) -> str:
    """Rectangles of panels and insets in virtual screen pixels, and which of `views`, their names, each shows.

    The first message on every connection.
    """
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
        }
        for p in wall.panels
    ]
    insets = [
        {"x": p.screen[0], "y": p.screen[1], "width": p.pixels[0], "height": p.pixels[1], "view": p.view}
        for p in wall.insets
    ]
    size = {"width": wall.width, "height": wall.height}
    return json.dumps({"kind": "layout", **size, "panels": panels, "insets": insets, "views": list(views)})


def status_message(status: Status, **more: Any) -> str:
    """Every field of Status but its parameters; what is not finite becomes null, which JSON can say."""
    values = asdict(replace(status, parameters=()))
    del values["parameters"]
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
