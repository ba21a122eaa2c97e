"""What the head showed is read back byte for byte; a full disk or a full log is said, and the wall goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wall.core.errors import ConfigError, RunError
from wall.display import image_log
from wall.display.image_log import ImageLog, read_log

BYTES_AN_IMAGE = 2 * 16 * 8 * 3


def logged(folder, shows, **options):
    log = ImageLog(folder, **options)
    log.begin(began=10.0, display_delay_s=0.02)
    for now, images in shows:
        log.take(images, now)
    log.close()
    return read_log(folder)


def test_what_was_shown_is_read_back(tmp_path, image):
    first, second = image(1, time=10.5, value=7, events=(2, 3)), image(2, time=11.0, value=90)

    found = logged(tmp_path, [(10.51, [first]), (11.02, [second])])

    assert (found.began, found.display_delay_s) == (10.0, 0.02)
    assert [(p.time, p.refresh, p.panel, p.version) for p in found.panels] == [
        (10.51, 10.5, "r0c0", 1), (10.51, 10.5, "r0c1", 1), (11.02, 11.0, "r0c0", 2), (11.02, 11.0, "r0c1", 2),
    ]  # fmt: skip
    assert (found.panels[0].camera_event, found.panels[0].scene_event) == (2, 3)
    for panel, wanted in zip(found.panels, (*first.panels, *second.panels), strict=True):
        assert np.array_equal(found.rgb(panel), wanted.rgb)
        assert (panel.screen, panel.size) == (wanted.screen, (16, 8))


def test_only_panels_that_changed_are_kept(tmp_path, image):
    before = image(1)
    after = replace(before, panels=(before.panels[0], replace(before.panels[1], version=2)))

    found = logged(tmp_path, [(0.0, [before]), (1.0, [before]), (2.0, [after])])

    assert [(p.time, p.panel) for p in found.panels] == [(0.0, "r0c0"), (0.0, "r0c1"), (2.0, "r0c1")]


def test_a_panel_of_two_sinks_is_kept_once(tmp_path, image):
    whole = image(1)
    window = replace(image(5, value=3), panels=(image(5, value=3).panels[1],))

    found = logged(tmp_path, [(0.0, [whole, window]), (1.0, [whole, window])])

    assert [(p.panel, p.version) for p in found.panels] == [("r0c0", 1), ("r0c1", 1)]


def test_log_has_a_largest_size_and_says_so(tmp_path, image):
    log = ImageLog(tmp_path, most_bytes=BYTES_AN_IMAGE)
    log.begin(began=0.0, display_delay_s=0.0)
    log.take([image(1)], 0.0)
    log.take([image(2)], 1.0)

    with pytest.raises(RunError, match=r"2 images of panels were not kept: .*wanted: a shorter run"):
        log.close()

    assert len(read_log(tmp_path).panels) == 2
    assert (tmp_path / image_log.PIXELS).stat().st_size == BYTES_AN_IMAGE


def test_full_disk_is_said_at_the_end(tmp_path, image):
    (tmp_path / image_log.PIXELS).symlink_to("/dev/full")
    log = ImageLog(tmp_path)
    log.begin(began=0.0, display_delay_s=0.0)
    log.take([image(1)], 0.0)

    with pytest.raises(RunError, match="2 images of panels were not kept: No space left on device"):
        log.close()


def test_log_that_was_cut_short_is_refused(tmp_path, image):
    logged(tmp_path, [(0.0, [image(1)])])
    index = tmp_path / image_log.INDEX
    index.write_text("\n".join(index.read_text().splitlines()[:-1]))

    with pytest.raises(ConfigError, match="not the index of recorded images"):
        read_log(tmp_path)
