"""Operators of one's own: installed packages add them by entry point."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from framelets import applied, random_framelet, rect

from wall.errors import ConfigError
from wall.operators.registry import OPERATORS, name_of, plugins

MODULE = '''\
from typing import ClassVar, Literal

from wall.operators.base import Input, Operator
from wall.operators.parts import copy, part


class Negative(Operator):
    """What is bright becomes dark."""

    op: Literal["negative"]
    input: Input

    def apply(self, inputs, out, region, prepared):
        copy(inputs[0], out, region)
        part(out, "colour", region)[...] = 1.0 - part(inputs[0], "colour", region)


class Nothing:
    pass


class Crop(Operator):
    op: Literal["crop"]


class Unnamed(Operator):
    input: Input
'''
Installed = Callable[..., None]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Installed:
    """Installs a package whose entry points of `wall.operators` are the given ones, until the test ends."""

    def install(*points: str, package: str = "greywall") -> None:
        folder = tmp_path / package
        info = folder / f"{package}-1.2.dist-info"
        info.mkdir(parents=True)
        (folder / f"{package}_operators.py").write_text(MODULE)
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
        assert all(field.description for name, field in operator.model_fields.items() if name != "op")
