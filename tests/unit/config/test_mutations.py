"""Whatever happens to a valid file: it loads, or ConfigError says why. Nothing else, ever."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from wall.config import yaml_text
from wall.config.loading import dump, load, loads
from wall.config.sampling import METHODS, FramelessSampling, switched
from wall.core.errors import ConfigError

CONFIGS = Path(__file__).parents[3] / "configs"
NAMES = ("demo", "two_compositors", "cave_corner", "two_panels", "walls/projectors", "walls/stereo")
TEXTS = [(CONFIGS / f"{name}.yaml").read_text() for name in NAMES]
TREES: list[Any] = [yaml_text.parse(text).values for text in TEXTS]
PIECES = [
    "",
    "\t",
    "\n",
    ": ",
    "- ",
    "[",
    "]",
    "{",
    "}",
    "&a ",
    "*a",
    "<<: ",
    "!!x ",
    "'",
    '"',
    "|",
    ">",
    "?",
    "%",
    "@",
    "nan",
    ".nan",
    "-.inf",
    "1e999",
    "0x",
    "0o9",
    "99999999999999999999",
    "\x00",
    "\ufeff",
    "é",
    "~",
    "true",
    "---\n",
]
JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=8),
    st.sampled_from(["auto", "sort-first"]),
    st.lists(st.integers(-2, 2), max_size=4),
    st.dictionaries(st.sampled_from(["type", "op", "id"]), st.text(max_size=3)),
)


def only_refused(text: str) -> None:
    """Load it; a refusal must be text that names the file, and what loads must come back from its dump."""
    refusals: list[str] = []
    try:
        config = loads(text, name="m.yaml").config
    except ConfigError as error:
        refusals = str(error).splitlines()
    else:
        assert loads(dump(config)).config == config
    assert all(line.startswith("m.yaml") for line in refusals)


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.data())
def test_text_with_pieces_cut_and_put_in_gives_only_config_errors(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from(TEXTS))
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(len(text), start + 20)))
        text = text[:start] + data.draw(st.sampled_from(PIECES)) + text[end:]

    only_refused(text)


@settings(max_examples=120, deadline=None, derandomize=True)
@given(st.data())
def test_values_replaced_removed_and_added_give_only_config_errors(data: st.DataObject) -> None:
    tree = copy.deepcopy(data.draw(st.sampled_from(TREES)))
    for _ in range(data.draw(st.integers(1, 3))):
        _mutate(tree, data)

    only_refused(yaml_text.write(tree))


def _mutate(tree: Any, data: st.DataObject) -> None:
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            return
        key = data.draw(st.sampled_from(keys))
        if not isinstance(node[key], (dict, list)) or data.draw(st.booleans()):
            break
        node = node[key]
    action = data.draw(st.sampled_from(["replace", "remove", "add"]))
    if action == "replace":
        node[key] = data.draw(JUNK)
    elif action == "remove":
        del node[key]
    elif isinstance(node, dict):
        node[data.draw(st.text(max_size=5))] = data.draw(JUNK)
    else:
        node.append(data.draw(JUNK))


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.text(max_size=60))
def test_any_text_gives_only_config_errors(text: str) -> None:
    only_refused(text)
    only_refused("version: 1\n" + text)


def test_switching_the_method_keeps_threads_batch_and_seed() -> None:
    sampling = FramelessSampling(threads=3, samples_per_batch=256, seed=9)

    for method in METHODS:
        other = switched(sampling, method)
        assert (other.method, other.threads, other.samples_per_batch, other.seed) == (method, 3, 256, 9)


def test_view_without_sampling_takes_the_top_level_one() -> None:
    config = load(CONFIGS / "sampler_hilbert.yaml").config

    assert config.sampling_of(0) == config.sampling
