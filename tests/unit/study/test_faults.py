"""What `wall measure faults` makes of what it saw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from wall.config.loading import load
from wall.core.errors import ConfigError
from wall.display.image_log import LoggedImages, LoggedPanel
from wall.display.viewer import Seen
from wall.roles.plan import Layout, make_layout
from wall.study.faults import faults

SIZE = (8, 4)  # of one panel that stands at x = 100
LEFT, RIGHT = (100.0, 0.0, 4.0, 4.0), (104.0, 0.0, 4.0, 4.0)


@pytest.fixture(scope="module")
def layout() -> Layout:
    """Renderers 2 and 3 have the left panel, 4 has the right one, which compositor 1 makes."""
    return make_layout(load(faults.OWN))


def log_of(*images: tuple[float, NDArray[np.uint8]]) -> LoggedImages:
    panels = tuple(
        LoggedPanel(
            time=time, refresh=time, panel="a", version=k, screen=(100, 0), size=SIZE, offset=3 * 8 * 4 * k,
            camera_event=k, scene_event=0, scene_time=0.0,
        )
        for k, (time, _) in enumerate(images)
    )  # fmt: skip
    pixels = np.concatenate([rgb.ravel() for _, rgb in images])
    return LoggedImages(began=0.0, display_delay_s=0.0, panels=panels, cpu_s=0.0, pixels=pixels)


def test_an_image_is_whole_again_when_most_of_what_moved_there_has_changed() -> None:
    """The left half moves before 1.0; at 1.2 half of it has changed again, at 1.5 all of it. The right one moves on."""
    images = []
    for k, time in enumerate((0.6, 0.8, 1.2, 1.5)):
        rgb = np.zeros((4, 8, 3), np.uint8)
        rgb[:, 4:] = k
        rgb[:, :4] = (0, 50, 50, 90)[k]
        rgb[:, : (0, 0, 2, 0)[k]] = 70
        images.append((time, rgb))
    log = log_of(*images)
    assert faults.whole_again(log, [LEFT], began=1.0, ended=1.0) == 500.0
    assert faults.whole_again(log, [RIGHT], began=1.0, ended=1.0) == 200.0
    assert faults.whole_again(log, [RIGHT], began=1.0, ended=1.3) == 200.0, "what changed before that does not count"
    assert faults.whole_again(log_of(*images[:3]), [LEFT], began=1.0, ended=1.0) is None, "half of it is missing"
    assert faults.whole_again(log, [(0.0, 0.0, 50.0, 4.0)], began=1.0, ended=1.0) is None, "nothing moved there"


def test_others_are_those_that_need_not_wait_for_the_rank(layout: Layout) -> None:
    def lost(rank: int | None) -> float | None:
        rates = {0.5: (0, 0, 10, 10, 10), 1.5: (0, 0, 0, 0, 0), 2.5: (0, 0, 5, 10, 0), 9.0: (0, 0, 0, 0, 0)}
        seen = [Seen(t, {"ranks": [{"samples_per_s": rate} for rate in of_ranks]}) for t, of_ranks in rates.items()]
        return faults.others_lost(layout, seen, rank, began=1.0, until=3.0, seconds=1.0)

    assert lost(4) == 25.0, "of renderers 2 and 3; that of the first second counts nothing"
    assert lost(2) == 50.0
    assert lost(1) == 25.0, "renderer 4 sends to it alone"
    assert lost(None) == 50.0


def test_a_row_says_what_is_not_as_wanted(layout: Layout) -> None:
    killed, frozen, *_, disk = faults.faults_of(layout)
    assert (killed.kind, killed.rank, frozen.kind, disk.kind) == ("killed", 4, "frozen", "full disk")
    assert faults._why_not_ok(killed, 90.0, 100.0, 2000.0, 10.0) == ""
    assert faults._why_not_ok(frozen, 390.0, 390.0, 2000.0, None) == ""
    found = faults._why_not_ok(killed, 390.0, None, None, 10.5)
    assert found == "noticed after 390.0 ms; not marked; no whole image; others lost 10.5 %"
    assert faults._why_not_ok(disk, None, None, None, 0.0) == ""
    last = [(fault.kind, fault.rank) for fault in faults.faults_of(layout, hosts=3)][-9:]
    network = [("cut", 4), ("slow link", 4), ("lossy link", 4), ("stranger", None), ("stranger kept out", None)]
    assert last == [*network, ("frozen", 0), ("slowed", 0), ("killed", 0), ("replaced", 0)]
    cut = faults.Fault(kind="cut", role="host", rank=4)
    assert "cut" not in [fault.kind for fault in faults.faults_of(layout, hosts=1)], "mpirun on one host"
    assert faults._why_not_ok(cut, 410.0, 390.0, 2000.0, None) == "noticed after 410.0 ms"


def test_a_wall_without_a_page_is_refused(tmp_path: Path) -> None:
    config = tmp_path / "wall.yaml"
    config.write_text(faults.OWN.read_text().replace("kind: browser", "kind: png"))
    with pytest.raises(ConfigError, match="no page"):
        faults.measure(config, seconds=2.0, out=tmp_path, say=print)
