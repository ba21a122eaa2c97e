"""What the browser sink sends of a panel: tiles that changed, then exactly what rests; or samples."""

from __future__ import annotations

import zlib
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from page_viewer import run, until, with_viewer

from wall.config.screens import GridConfig, WallConfig
from wall.core.colour import srgb_decoded
from wall.core.tone_mapping import AS_IT_IS
from wall.display import parts
from wall.display.base import PanelImage, PanelSamples, WallImage
from wall.display.browser import IN_FLIGHT, Browser
from wall.display.parts import TILES_AT_REST, Held, PanelChanges, parts_of
from wall.display.sample_store import codes_of_halves
from wall.display.stream import SAMPLES_COUNTS, SAMPLES_HEADER
from wall.display.tiles import updated
from wall.geometry.expanding import expand


@pytest.fixture
def large():
    """A panel of 200 x 100 pixels, 7 x 4 tiles, and its sink."""
    wall = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(200, 100), size=(2.0, 1.0))))
    with closing(Browser("127.0.0.1", 0, wall)) as sink:
        yield sink


def wall_image(panel):
    return WallImage(width=200, height=100, panels=(panel,), time=0.0, camera_event=0, scene_event=0)


def gradient(shift=0):
    y, x = np.mgrid[:100, :200]
    return np.stack([x + shift, 2 * y + shift, x // 2 + y], -1).astype(np.uint8)


def test_only_changed_tiles_are_sent_and_what_rests_follows_exactly(large, status):
    black = PanelImage(id="p0", rgb=np.zeros((100, 200, 3), np.uint8), screen=(0, 0), version=0)
    first = updated(black, gradient(), 1)
    rgb = gradient()
    rgb[40:60, 130:150] = 255
    second = updated(first, rgb, 2)

    async def act(viewer):
        large.show(wall_image(first), status)
        number, panels = await viewer.next_image()
        assert viewer.sent_tiles[0] == []
        assert 0 < np.abs(panels[0][1].astype(int) - first.rgb).max() <= 8
        await viewer.drawn(number)
        large.show(wall_image(second), status)
        number, panels = await viewer.next_image()
        assert viewer.sent_tiles[0] == [11]  # the square lies within one tile
        await viewer.drawn(number)
        number, panels = await viewer.next_image()
        assert panels[0] == (2, pytest.approx(second.rgb, abs=0))
        await viewer.drawn(number)
        assert await viewer.silent_while(1.2)  # longer than a panel must rest

    with_viewer(large, act)


def test_a_slow_viewer_that_makes_images_itself_gets_each_pixel_s_newest_sample_once(large, status):
    """However many samples come while it draws, they wait in one store of the panel's size."""
    rng, rgb = np.random.default_rng(4), gradient()
    radiance = srgb_decoded(rgb / 255.0).astype(np.float32)

    def shown(version, pixels):
        image = PanelImage(id="p0", rgb=rgb.copy(), screen=(0, 0), version=version)
        samples = PanelSamples(panel=0, pixels=pixels, radiance=radiance.reshape(-1, 3)[pixels], tone=AS_IT_IS)
        large.show(replace(wall_image(image), samples=(samples,)), status)

    def changed(version):
        pixels = np.sort(rng.choice(5000, 400, replace=False))
        rgb.reshape(-1, 3)[pixels] = version
        radiance.reshape(-1, 3)[pixels] = srgb_decoded(np.float32(version / 255))
        shown(version, pixels)

    async def next_samples(viewer):
        while (message := await viewer.socket.receive_json())["kind"] != "picture":
            continue
        data = await viewer.socket.receive_bytes()
        assert (data[:2], message["panels"]) == (b"WN", 1)
        body = zlib.decompress(data[SAMPLES_HEADER.size :])
        count = SAMPLES_COUNTS.unpack_from(body)[2]
        return message["number"], np.frombuffer(body, "<u2", 3 * count, SAMPLES_COUNTS.size)

    async def act(viewer):
        await viewer.socket.send_json({"kind": "display", "value": "samples"})
        await until(lambda: large.wants_samples)
        shown(1, np.arange(20_000))
        _, light = await next_samples(viewer)
        assert np.array_equal(codes_of_halves(1.0)[light], rgb.ravel())
        for version in range(2, 200):  # not one is drawn: two images are on their way at most
            changed(version)
        sent, early = await next_samples(viewer)
        assert len(early) <= 3 * 5000
        changed(200)  # one that the early message cannot have, however late it was made
        await viewer.drawn(sent)
        _, late = await next_samples(viewer)
        assert len(late) <= 3 * 5000

    with_viewer(large, act)
    assert large.sent_bytes < 20_000 * 6 + 2 * 5000 * 8  # all of the panel once, and its changed part twice
    run(until(lambda: not large.wants_samples))  # once the server has noticed that the viewer has gone


def test_a_large_panel_at_rest_follows_in_parts_that_a_change_interrupts(two_panels, status):
    wall = expand(WallConfig(grid=GridConfig(columns=1, rows=1, pixels=(640, 320), size=(2.0, 1.0))))
    rgb = np.random.default_rng(1).integers(0, 256, (320, 640, 3), np.uint8)
    first = updated(PanelImage(id="p0", rgb=np.zeros_like(rgb), screen=(0, 0), version=0), rgb, 1)
    changed = rgb.copy()
    changed[0, 0] ^= 255
    second = updated(first, changed, 2)

    async def act(viewer):
        browser.show(wall_image(first), status)
        await viewer.drawn((await viewer.next_image())[0])
        number, _ = await viewer.next_image()
        assert viewer.sent_tiles[0] == list(range(TILES_AT_REST))
        browser.show(wall_image(second), status)
        await viewer.drawn(number)
        while viewer.sent_tiles[0] != [0]:
            number, _ = await viewer.next_image()
            await viewer.drawn(number)
        while not np.array_equal(viewer.panels[0], changed):
            number, _ = await viewer.next_image()
            await viewer.drawn(number)

    with closing(Browser("127.0.0.1", 0, wall)) as browser:
        with_viewer(browser, act)


def test_a_slow_viewer_gets_the_tiles_of_all_that_it_missed(large, status):
    image = updated(PanelImage(id="p0", rgb=np.zeros((100, 200, 3), np.uint8), screen=(0, 0), version=0), gradient(), 1)

    async def act(viewer):
        nonlocal image
        large.show(wall_image(image), status)
        numbers = [(await viewer.next_image())[0]]
        for version, x in enumerate((5, 70, 140), 2):
            rgb = image.rgb.copy()
            rgb[5, x] ^= 128
            image = updated(image, rgb, version)
            large.show(wall_image(image), status)
            if version <= IN_FLIGHT:
                numbers.append((await viewer.next_image())[0])
        await viewer.drawn(numbers[-1])
        await viewer.next_image()
        assert viewer.sent_tiles[0] == [2, 4]

    with_viewer(large, act)


def test_a_viewer_for_whom_an_older_image_was_taken_gets_the_newest_that_another_one_has():
    black = PanelImage(id="p0", rgb=np.zeros((100, 200, 3), np.uint8), screen=(0, 0), version=0)
    first = updated(black, gradient(), 4)
    rgb = gradient()
    rgb[5, 5] ^= 128
    second = updated(first, rgb, 5)
    changes, quick, slow = PanelChanges(), Held(), Held()

    def sent(held, panel):
        [part] = parts_of(held, panel, None, changes, 0.0)
        part.sent(held, *part.encode())
        return part.panel.version, held.version, np.flatnonzero(part.tiles).tolist()

    assert [sent(held, first)[0] for held in (quick, slow)] == [4, 4]
    assert sent(quick, second) == sent(slow, first) == (5, 5, [0])


def test_changes_that_nobody_sees_wait_until_their_tile_rests_and_add_up(large, status, monkeypatch):
    """By at most 2 codes nothing is sent at once; 1 code in each of 3 images is visible; what rests is exact."""
    monkeypatch.setattr(parts, "REST_S", 60.0)
    black = PanelImage(id="p0", rgb=np.zeros((100, 200, 3), np.uint8), screen=(0, 0), version=0)
    image = updated(black, gradient(), 1)

    async def act(viewer):
        nonlocal image
        large.show(wall_image(image), status)
        await viewer.drawn((await viewer.next_image())[0])
        for version in range(2, 5):
            rgb = image.rgb.copy()
            rgb[5, 5] += 1  # in tile 0
            rgb[50, 180, 1] ^= 1  # in tile 12: never off by more than 1
            image = updated(image, rgb, version)
            large.show(wall_image(image), status)
            if version < 4:
                assert await viewer.silent_while(0.05)
        number, panels = await viewer.next_image()
        assert (panels[0][0], viewer.sent_tiles[0]) == (4, [0])
        monkeypatch.setattr(parts, "REST_S", 0.1)
        while not np.array_equal(viewer.panels[0], image.rgb):
            await viewer.drawn(number)
            number, _ = await viewer.next_image()
            assert viewer.encodings[0] == {b"RIFF"}

    with_viewer(large, act)


def test_what_has_few_colours_comes_without_losses_at_once_beside_a_jpeg(large, status):
    """Letters, of two colours, on the left; on the right a gradient with noise, as of few samples."""
    rng, rgb = np.random.default_rng(3), gradient()
    rgb[:96, 96:] += rng.integers(0, 20, (96, 104, 3), np.uint8)
    rgb[:, :96] = 255 * np.kron(rng.integers(0, 2, (25, 24, 1), np.uint8), np.ones((4, 4, 3), np.uint8))
    image = updated(PanelImage(id="p0", rgb=np.zeros_like(rgb), screen=(0, 0), version=0), rgb, 1)

    async def act(viewer):
        large.show(wall_image(image), status)
        _, panels = await viewer.next_image()
        assert viewer.encodings[0] == {b"RIFF", b"\xff\xd8\xff\xe0"}
        assert np.array_equal(panels[0][1][:, :96], rgb[:, :96])
        assert not np.array_equal(panels[0][1][:, 96:], rgb[:, 96:])

    with_viewer(large, act)
