"""What the page is sent, as bytes and JSON text. Pure, no I/O.

A picture is one JSON message `picture` that says how many panels follow, then one binary message a panel:
HEADER, then a JPEG. Only panels that changed since the viewer's last picture are sent.
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import asdict
from typing import Any

import simplejpeg

from wall.display.base import PanelPicture, Status, WallPicture
from wall.geometry.panels import Wall

HEADER = struct.Struct("<2sBxHHHxxII")   # "WP", format, panel, width, height, version, picture number
FORMAT = 1
QUALITY = 88                             # JPEG with full colour: 0.5 ms and 40 kB for 480x270, no visible blocks


def encode_jpeg(panel: PanelPicture) -> bytes:
    """(h, w, 3) uint8 sRGB to JPEG; releases the GIL."""
    jpeg: bytes = simplejpeg.encode_jpeg(panel.rgb, QUALITY, "RGB", "444", True)
    return jpeg


def panel_message(index: int, panel: PanelPicture, *, jpeg: bytes, number: int) -> bytes:
    """One panel of picture `number`. Counts wrap at 2^32, which takes two years at 60 Hz."""
    height, width = panel.rgb.shape[:2]
    header = HEADER.pack(
        b"WP", FORMAT, index, width, height, panel.version & 0xFFFFFFFF, number & 0xFFFFFFFF
    )
    return header + jpeg


def picture_message(picture: WallPicture, *, panels: int, number: int) -> str:
    """Announces picture `number`, of which `panels` binary messages follow."""
    return json.dumps(
        {
            "kind": "picture",
            "number": number,
            "panels": panels,
            "time": picture.time,
            "camera_event": picture.camera_event,
            "scene_event": picture.scene_event,
        }
    )


def layout_message(wall: Wall) -> str:
    """Where the panels are, in virtual screen pixels; the first message on every connection."""
    panels = [
        {"id": p.id, "x": p.screen[0], "y": p.screen[1], "width": p.pixels[0], "height": p.pixels[1]}
        for p in wall.panels
    ]
    return json.dumps({"kind": "layout", "width": wall.width, "height": wall.height, "panels": panels})


def status_message(status: Status, **more: Any) -> str:
    """Every field of Status; what is not finite becomes null, which JSON can say."""
    return json.dumps(_finite({"kind": "status", **asdict(status), **more}), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(v) for name, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
