"""What a page cannot be served with, and where nothing can listen, is refused before anything is loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from wall.config.loading import loads
from wall.core.errors import ConfigError
from wall.roles.plan import Layout, make_layout
from wall.run.launch import check_bind
from wall.run.sinks import check_page

TEXT = """\
version: 1
scene: {source: courtyard}
wall: {grid: {columns: 1, rows: 1, pixels: [32, 24], size: [0.4, 0.3]}}
views: [{camera: auto}]
"""


def layout_of(folder: Path, more: str) -> Layout:
    return make_layout(loads(TEXT + more + "\n", name="wall.yaml", path=folder / "wall.yaml"))


@pytest.mark.parametrize(
    ("output", "said"),
    [
        ("{browser: {port: 8877}, metrics: 8877}", r"wall\.yaml:5:42: output\.metrics = 8877: is the port of the page"),
        ("{browser: {watch_token: none}}", r"output\.browser\.watch_token = 'none': .*none: No such file"),
        ("{browser: {tls: {certificate: a.pem, key: b.pem}}}", r"output\.browser\.tls: .*a\.pem with .*b\.pem: "),
    ],
)
def test_what_is_in_the_way_is_named_with_its_place(tmp_path: Path, output: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        check_page(layout_of(tmp_path, f"output: {output}"))
    check_page(layout_of(tmp_path, f"output: {output}\ngraph: {{sinks: [png]}}".replace(", metrics: 8877", "")))
    check_page(layout_of(tmp_path, f"output: {output}".replace(", metrics: 8877", "")), headless=True)


def test_an_address_of_another_machine_is_refused_with_its_place(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"wall\.yaml:5:19: transport\.bind = '203\.0\.113\.9': cannot listen there"):
        check_bind(layout_of(tmp_path, "transport: {bind: 203.0.113.9}"))
    check_bind(layout_of(tmp_path, "transport: {bind: 203.0.113.9, kind: loopback}"))
    check_bind(layout_of(tmp_path, "transport: {bind: 0.0.0.0}"))
