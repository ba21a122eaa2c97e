"""Operators of one's own: installed packages add them by entry point."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from framelets import applied, random_framelet, rect

from wall.core.errors import ConfigError
from wall.operators.registry import OPERATORS, name_of, plugins

MODULE = '''\
from typing import ClassVar, Literal

from wall.operators.base import Input, Operator
from wall.operators.regions import copy, pixels_of


class Negative(Operator):
    """What is bright becomes dark."""

    op: Literal["negative"]
    input: Input

    def apply(self, inputs, out, region, prepared):
        copy(inputs[0], out, region)
        pixels_of(out, "colour", region)[...] = 1.0 - pixels_of(inputs[0], "colour", region)


class Nothing:
    pass


class Crop(Operator):
    op: Literal["crop"]


class Unnamed(Operator):
    input: Input
'''
DOCUMENT = Path(__file__).parents[3] / "docs" / "guide" / "operators.md"
Installed = Callable[..., None]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Installed:
    """Installs a package whose entry points of `wall.operators` are the given ones, until the test ends."""

    def install(*points: str, package: str = "greywall", name: str = "", module: str = MODULE) -> None:
        folder = tmp_path / package
        info = folder / f"{package}-1.2.dist-info"
        info.mkdir(parents=True)
        (folder / f"{name or package + '_operators'}.py").write_text(module)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        (info / "entry_points.txt").write_text("[wall.operators]\n" + "\n".join(points) + "\n")
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.setattr(sys, "modules", dict(sys.modules))

    return install


def test_an_installed_operator_is_found_and_works(installed: Installed, random_numbers: np.random.Generator) -> None:
    installed("negative = greywall_operators:Negative")
    negative = plugins()["negative"]
    source = random_framelet(random_numbers, rect(0, 0, 4, 3))
    operator = negative.model_validate({"id": "n", "op": "negative", "input": "a"})
    np.testing.assert_array_equal(applied(operator, source).colour, 1.0 - source.colour)


def test_the_documented_operator_works(installed: Installed, random_numbers: np.random.Generator) -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    (module,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (point,) = re.findall(r'```toml\n\[project\.entry-points\."wall\.operators"\]\ngrey = "(.*)"\n```', text)
    installed(f"grey = {point}", module=module, name="grey")
    source = random_framelet(random_numbers, rect(0, 0, 4, 3))
    out = applied(plugins()["grey"].model_validate({"id": "g", "op": "grey", "input": "w", "share": 0.5}), source)
    grey = source.colour @ np.float32([0.2126, 0.7152, 0.0722])
    np.testing.assert_allclose(out.colour, (source.colour + grey[..., None]) / 2, atol=1e-6)


def test_every_operator_and_its_keys_are_documented() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` (\|.*)$", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE))
    assert rows.keys() - {"op"} == OPERATORS.keys()
    for word, operator in OPERATORS.items():
        for key in operator.model_fields.keys() - {"id", "on", "op", "input", "inputs"}:
            assert re.search(rf"`{key}\b", rows[word]), f"{word}: {key}"
        assert ("| any |" in rows[word]) == ("inputs" in operator.model_fields)
        assert ("| one |" in rows[word]) == ("input" in operator.model_fields)
        assert all(f"`{channel}`" in rows[word] for channel in operator.NEEDS - {"colour"})


def test_without_packages_there_are_no_plugins() -> None:
    assert plugins() == {}


@pytest.mark.parametrize(
    ("point", "reasons"),
    [
        ("negative = greywall_operators:Positive", ["cannot be loaded, AttributeError", "Positive"]),
        ("negative = greywall_missing:Negative", ["cannot be loaded, ModuleNotFoundError", "greywall_missing"]),
        ("nothing = greywall_operators:Nothing", ["wanted a class derived from wall.operators.base.Operator"]),
        ("inverse = greywall_operators:Negative", ["wanted Literal['inverse']", "negative"]),
        ("unnamed = greywall_operators:Unnamed", ["its `op` is missing"]),
        ("crop = greywall_operators:Crop", ["'crop' is built in, wanted another name"]),
        ("sink = greywall_operators:Negative", ["'sink' is built in, wanted another name"]),
    ],
)
def test_a_broken_plugin_is_refused_with_its_package_and_the_reason(
    point: str, reasons: list[str], installed: Installed
) -> None:
    installed(point)
    with pytest.raises(ConfigError) as caught:
        plugins()
    for text in ["greywall 1.2", f"operator '{point.split()[0]}'", *reasons]:
        assert text in str(caught.value)


def test_two_packages_cannot_give_the_same_name(installed: Installed) -> None:
    installed("negative = greywall_operators:Negative")
    installed("negative = darkwall_operators:Negative", package="darkwall")
    with pytest.raises(ConfigError, match=r"package darkwall 1\.2 has one of the same name"):
        plugins()


def test_every_built_in_operator_says_what_it_is() -> None:
    for word, operator in OPERATORS.items():
        assert name_of(operator) == word
        assert operator.__doc__
        assert all(field.description for field in operator.model_fields.values())
