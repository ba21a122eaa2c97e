"""What tests of the page do with it: wait, find, drag."""

from __future__ import annotations

import pytest


def eventually(page, condition, what):
    """Poll until the condition holds; the page goes on meanwhile."""
    for _ in range(300):
        if condition():
            return
        page.wait_for_timeout(20)
    pytest.fail(f"never happened: {what}")


def find(page, selector):
    """Wait until something matches, visible or not. Playwright's own wait looks only every half second."""
    eventually(page, lambda: page.locator(selector).count() > 0, selector)


def middle(page):
    box = page.locator("#wall").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["height"]


def drag(page, dx, dy, *, button="left"):
    """Drag from the wall's middle by fractions of its height."""
    x, y, height = middle(page)
    page.mouse.move(x, y)
    page.mouse.down(button=button)
    page.mouse.move(x + dx * height, y + dy * height, steps=6)
    page.mouse.up(button=button)


def close_after_the_run(page):
    """Close a page whose run has ended, without the lines in which Chromium itself tells that.

    The page looks for the next run until it is closed, and each time there is another line.
    """
    page.close()
    page.complaints = [text for text in page.complaints if "WebSocket connection" not in text]
