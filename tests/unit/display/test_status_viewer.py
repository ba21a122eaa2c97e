"""A viewer that keeps what it is told goes on when its page comes again."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from urllib.parse import urlsplit

from running import comes

from wall.display.browser import Browser
from wall.display.viewer import StatusViewer


def test_it_connects_again_to_a_page_that_was_gone(two_panels, image, status):
    with closing(Browser("127.0.0.1", 0, two_panels)) as first:
        first.show(image(), status)
        viewer = StatusViewer(first.address)
        comes(lambda: bool(viewer.seen), "a status")
    with closing(viewer), closing(Browser("127.0.0.1", urlsplit(first.address).port, two_panels)) as second:
        second.show(image(2), replace(status, seconds=99.0))
        comes(lambda: viewer.seen[-1].status["seconds"] == 99.0, "that of the page that came again")


def test_it_ends_where_there_is_no_page():
    with closing(StatusViewer("http://127.0.0.1:9/")) as viewer:
        assert viewer.seen == []
