"""A folder of results is one wall's at a time."""

from __future__ import annotations

import os
import resource
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from wall.core.errors import RunError
from wall.run.control_file import Control, announced, check_free, claimed, read

WALLS = 4
PATIENCE_S = 10.0


def test_of_walls_that_start_at_once_one_gets_the_folder(tmp_path: Path) -> None:
    begin, end = Barrier(WALLS), Barrier(WALLS)

    def wall(number: int) -> str:
        begin.wait(PATIENCE_S)
        try:
            with claimed(tmp_path):
                end.wait(PATIENCE_S)
                return ""
        except RunError as error:
            end.wait(PATIENCE_S)
            return str(error)

    with ThreadPoolExecutor(WALLS) as pool:
        for _ in range(20):
            said = sorted(pool.map(wall, range(WALLS)))
            assert said[0] == ""
            assert all("another wall writes its results there; wanted: another --out" in each for each in said[1:])


def test_who_has_the_folder_is_said_and_it_is_free_after_the_end(tmp_path: Path) -> None:
    here = Control(endpoint="tcp://h:1", key="k", head="", host="h", pid=os.getpid())
    with claimed(tmp_path), announced(tmp_path, here):
        for another in (claimed(tmp_path).__enter__, lambda: check_free(tmp_path)):
            with pytest.raises(RunError, match=rf"there \(process {os.getpid()} on h\)"):
                another()
    with claimed(tmp_path):
        assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_is_told_with_the_file_and_nothing_stays(tmp_path: Path) -> None:
    here = Control(endpoint="tcp://h:1", key="k", head="", host="h", pid=os.getpid())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))  # bytes
    try:
        with pytest.raises(RunError, match=rf"cannot write {tmp_path}/control.json: File too large"):
            announced(tmp_path, here).__enter__()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_where_a_page_is_that_came_later_is_written_and_nothing_stays(tmp_path: Path) -> None:
    here = Control(endpoint="tcp://h:1", key="k", head="", host="h", pid=os.getpid())
    in_the_way = tmp_path / f".control.json.{os.getpid()}"
    with announced(tmp_path, here) as tell_page:
        tell_page("http://h:2/")
        in_the_way.mkdir()
        with pytest.raises(RunError, match="cannot write"):
            tell_page("http://h:3/")
        assert read(tmp_path).page == "http://h:2/"
    assert list(tmp_path.iterdir()) == [in_the_way]
