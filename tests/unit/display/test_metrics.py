"""Metrics: the text that Prometheus reads, and who gets it at the page's server and at one of its own."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace

import aiohttp
import pytest
from page_viewer import run

from wall.core.errors import RunError
from wall.display.base import LATENCY_LIMITS_S, RankTotals
from wall.display.browser import Browser
from wall.display.gate import Access, token_in
from wall.display.metrics import PageCounts, metrics_text
from wall.display.metrics_server import MetricsServer

FIXED = "a-token-of-our-own"


@pytest.fixture
def status(status):
    first = RankTotals(
        host='a"b', seconds=2.0, samples=10, bytes=80, memory=4096, credit=512, dropped={"late": 3, "bad_packet": 1}
    )
    return replace(status, totals=(first, RankTotals(host="")))


def test_every_rank_that_has_spoken_has_its_numbers_and_names_are_escaped(status):
    lines = metrics_text(status, PageCounts(viewers=2)).splitlines()
    assert 'wall_rank_up{rank="0",role="renderer",panel="r0c0",host="a\\"b"} 1' in lines
    at = lines.index("# TYPE wall_rank_dropped_total counter")
    assert lines[at + 1 :] == [
        'wall_rank_dropped_total{rank="0",reason="bad_packet"} 1',
        'wall_rank_dropped_total{rank="0",reason="late"} 3',
    ]
    found = [line for line in lines if line.startswith("wall_rank_") and "_up{" not in line]
    assert {'wall_rank_samples_total{rank="0"} 10', 'wall_rank_sent_bytes_total{rank="0"} 80'} <= set(found)
    assert {'wall_rank_memory_bytes{rank="0"} 4096', 'wall_rank_credit_bytes{rank="0"} 512'} <= set(found)
    assert [line for line in found if 'rank="1"' in line] == ['wall_rank_oldest_sample_age_seconds{rank="1"} Inf']
    assert "wall_page_viewers 2" in lines


def test_latencies_are_a_histogram_whose_classes_hold_all_below_them(status):
    counts = [0] * (len(LATENCY_LIMITS_S) + 1)
    counts[0], counts[2], counts[-1] = 2, 3, 1
    text = metrics_text(replace(status, latency_counts=tuple(counts), latency_sum_s=9.25), PageCounts())
    found = dict(line.rsplit(" ", 1) for line in text.splitlines() if line.startswith("wall_input_latency"))
    assert found['wall_input_latency_seconds_bucket{le="0.005"}'] == "2"
    assert found['wall_input_latency_seconds_bucket{le="5.0"}'] == "5"
    assert found['wall_input_latency_seconds_bucket{le="+Inf"}'] == found["wall_input_latency_seconds_count"] == "6"
    assert found["wall_input_latency_seconds_sum"] == "9.25"


def answers(address, *paths, token=""):
    """Status and text of each path; `token`: brought as Prometheus does."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}

    async def act():
        found = []
        async with aiohttp.ClientSession(headers=headers) as session:
            for path in paths:
                async with session.get(address.partition("?")[0].removesuffix("metrics") + path) as response:
                    found.append((response.status, await response.text()))
        return found

    return run(act())


def test_the_page_serves_metrics_to_those_whom_it_lets_watch(two_panels, image, status):
    with closing(Browser("127.0.0.1", 0, two_panels, access=Access(tokens=True, watch_token=FIXED))) as browser:
        assert f"?token={FIXED}" in browser.watch_address
        [(refused, _)] = answers(browser.address, "metrics", token="another-token-here")
        [(_, before)] = answers(browser.address, "metrics", token=FIXED)
        browser.show(image(1), status)
        [(_, after), (_, whole)] = answers(browser.address, "metrics", "status.json", token=FIXED)
    assert refused == 403
    assert 'wall_page_dropped_total{reason="browser_no_token"} 1' in before
    assert "wall_rank_up" not in before
    assert 'wall_rank_samples_total{rank="0"} 10' in after
    assert json.loads(whole)["totals"][0]["dropped"] == {"late": 3, "bad_packet": 1}


def test_without_a_page_metrics_have_a_server_of_their_own(status):
    with closing(MetricsServer("127.0.0.1", 0, access=Access(tokens=True, watch_token=FIXED))) as server:
        [(early, _)] = answers(server.address, "status.json", token=FIXED)
        server.tell(status)
        found = answers(server.address, "metrics", "status.json", "stream", token=FIXED)
        [(refused, _)] = answers(server.address, "metrics")
    assert [early, *(code for code, _ in found), refused] == [503, 200, 200, 404, 403]
    assert server.address.endswith(f"/metrics?token={FIXED}")
    assert 'wall_rank_samples_total{rank="0"} 10' in found[0][1]


@pytest.mark.parametrize("text", ["", "short", "sixteen letters and spaces", "x" * 2000])
def test_a_file_without_a_token_that_serves_is_refused_by_name(tmp_path, text):
    file = tmp_path / "watch.token"
    file.write_text(text)
    with pytest.raises(RunError, match=rf"output\.browser\.watch_token: {file}"):
        token_in(file)
    file.write_text(FIXED + "\n")
    assert token_in(file) == FIXED
