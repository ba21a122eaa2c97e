"""Panels that windows show, images for them, and what the screen looks like then."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from x_servers import comes_true, screenshot

from wall.config.displays import WindowConfig
from wall.config.screens import GridConfig, PanelConfig, WallConfig
from wall.display.base import PanelImage
from wall.geometry.expanding import expand
from wall.geometry.panels import Panel

RGB = NDArray[np.uint8]


def panels(*pixels: tuple[int, int], **changes: Any) -> list[Panel]:
    """Panels in a row; a change is a list of what each of them has, or what all of them have."""
    made, x = list[Panel](), 0
    for k, (width, height) in enumerate(pixels):
        own = {name: value[k] if isinstance(value, list) else value for name, value in changes.items()}
        configured = {name: own.pop(name) for name in set(own) & set(PanelConfig.model_fields)}
        grid = GridConfig(columns=1, rows=1, pixels=(width, height), size=(width / 100, height / 100), id=f"p{k}")
        panel = expand(WallConfig(grid=grid)).panels[0]
        config = panel.config.model_copy(update=configured)
        made.append(replace(panel, **({"config": config, "screen": (x, 0), "index": k, "of": f"p{k}"} | own)))
        x += width
    return made


def window(x: int, y: int, width: int, height: int) -> WindowConfig:
    return WindowConfig(x=x, y=y, width=width, height=height)


def noise(width: int, height: int, seed: int = 1) -> RGB:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def shown(panel: Any, rgb: RGB, version: int = 1) -> PanelImage:
    return PanelImage(id=panel.id, rgb=rgb, screen=panel.screen, version=version)


def on_black(width: int, height: int, *parts: tuple[int, int, RGB]) -> RGB:
    """A black screen with images at their (x, y)."""
    screen = np.zeros((height, width, 3), np.uint8)
    for x, y, rgb in parts:
        screen[y : y + rgb.shape[0], x : x + rgb.shape[1]] = rgb
    return screen


def looks_like(display: str, wanted: RGB) -> bool:
    """Whether a screen has exactly these pixels, or gets them in time."""
    return comes_true(lambda: np.array_equal(screenshot(display), wanted))
