"""Whatever a file holds, a converter gives a conversion or refuses it: ConfigError, and nothing else."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wall.core.errors import ConfigError
from wall.importers.command import convert_text

SOURCES = {
    "paraview": (
        '<pvx><EyeSeparation Value="0.06"/><Machine Name="a" Environment="DISPLAY=:0" Geometry="300x200+3+0" '
        'StereoType="Left" ViewerId="0" LowerLeft="-1 -1 -1" LowerRight="1 -1 -1" UpperRight="1 1 -1"/></pvx>'
    ),
    "displaycluster": (
        '<configuration><dimensions numTilesWidth="2" numTilesHeight="1" screenWidth="40" screenHeight="30" '
        'mullionWidth="5" mullionHeight="-5" fullscreen="0"/><process host="a" display=":0" stereo="left">'
        '<screen x="0" y="0" i="0" j="0"/><screen x="40" y="0" i="1" j="0"/></process></configuration>'
    ),
    "tide": (
        '{"surfaces": [{"displayWidth": 40, "displayHeight": 30, "screenCountX": 2, "bezelWidth": 5, '
        '"dimensions": [2.5, 1.5]}], "processes": [{"host": "a", "screens": [{"i": 1, "stereo": "left", "x": 4}]}]}'
    ),
    "sgct": (
        '{"nodes": [{"address": "a", "windows": [{"size": {"x": 64, "y": 48}, "monitor": 1, "stereo": "top_bottom", '
        '"pos": {"x": 3, "y": 4}, "viewports": [{"pos": {"x": 0, "y": 0}, "size": {"x": 1, "y": 0.5}, "projection": '
        '{"type": "PlanarProjection", "fov": {"hfov": 80, "vfov": 50}, "orientation": {"yaw": 9, "pitch": 1, '
        '"roll": 2}, "distance": 2}}]}]}], "users": [{"eyeseparation": 0.06, "pos": {"x": 0, "y": 0, "z": 4}}]}'
    ),
    "sage2": (
        "{resolution: {width: 40, height: 30}, layout: {rows: 1, columns: 2}, dimensions: {tile_width: 1.2, "
        "tile_borders: [0.01, 0.02, 0.03, 0.04], viewing_distance: 2}, displays: [{row: 0, column: 0, width: 2}]}"
    ),
}
SOURCES["mpcdi"] = (
    '<MPCDI profile="3d" version="2.0"><display><buffer id="b"><region id="a" xResolution="24" yResolution="15" x="0" '
    'y="0" xsize="1" ysize="1"><frustum><yaw>5</yaw><pitch>-10</pitch><roll>7</roll><rightAngle>12</rightAngle>'
    "<leftAngle>-20</leftAngle><upAngle>10</upAngle><downAngle>-10</downAngle></frustum></region></buffer></display>"
    '<files><fileset region="a"><geometryWarpFile><path>a.pfm</path></geometryWarpFile></fileset></files></MPCDI>'
)
ODD = [
    "", "0", "-1",
    "1e999", "NaN", "Infinity", "-Infinity", "9" * 40, "1e-30", "1e8", "null", "true", "[]", "{}", '"', "'",
    "<", ">", "&amp;", "[" * 50, "\0", "\ufeff", "\ud800", "\U0001f600", "x", ",", ":", "\n", "/*", "16385", "70000",
]  # fmt: skip


@st.composite
def mutated(draw: st.DrawFn, text: str) -> str:
    """A text with up to four of its parts replaced, doubled or left out."""
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        end = draw(st.integers(start, min(len(text), start + 12)))
        text = text[:start] + draw(st.one_of(st.sampled_from(ODD), st.just(text[start:end] * 2))) + text[end:]
    return text


@pytest.mark.parametrize("name", SOURCES)
def test_mutated_files_are_converted_or_refused(name: str) -> None:
    @settings(max_examples=60, deadline=None, derandomize=True, database=None)
    @given(mutated(SOURCES[name]))
    def converted_or_refused(text: str) -> None:
        with contextlib.suppress(ConfigError):
            convert_text(text, "w.any", name)

    converted_or_refused()


@pytest.mark.parametrize("name", SOURCES)
def test_odd_values_in_place_of_each_value_are_converted_or_refused(name: str) -> None:
    """Every number of every source becomes each odd value in turn."""
    text = SOURCES[name]
    starts = [k for k, ch in enumerate(text) if ch.isdigit() and not text[k - 1].isalnum() and text[k - 1] not in ".-:"]
    assert len(starts) >= 8
    for start in starts:
        end = start
        while end < len(text) and (text[end].isalnum() or text[end] == "."):
            end += 1
        for odd in ("0", "-1", "NaN", "9" * 40, "1e-30", "1e8", "1.5"):
            with contextlib.suppress(ConfigError):
                convert_text(text[:start] + odd + text[end:], "w.any", name)


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(st.text(max_size=60) | st.sampled_from(ODD))
def test_any_text_is_refused_or_converted(text: str) -> None:
    with contextlib.suppress(ConfigError):
        convert_text(text, "w.any")


def test_a_mutation_does_reach_the_end_of_every_converter() -> None:
    for name, text in SOURCES.items():
        assert convert_text(text, "w.any", name)[1].panels >= 1
