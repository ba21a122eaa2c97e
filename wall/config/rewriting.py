"""Replace `wall:` in a configuration's text; everything else stays as written, comments included."""

from __future__ import annotations

from wall.config import yaml_text
from wall.config.loading import Loaded, dump, load, loads
from wall.config.screens import WallConfig
from wall.core.errors import ConfigError


def with_wall(loaded: Loaded, wall: WallConfig) -> str:
    """YAML of the file that `loaded` came from with `wall` in it. Raises ConfigError if the file is gone or changed."""
    if load(loaded.path).config != loaded.config:
        raise ConfigError(f"{loaded.path}: has changed since it was loaded; wanted: the same text")
    wanted = loaded.config.model_copy(update={"wall": wall})
    written = yaml_text.write({"wall": wall.model_dump(mode="json", exclude_none=True, exclude_defaults=True)})
    text = _spliced(loaded, written)
    try:
        return text if loads(text).config == wanted else dump(wanted)
    except ConfigError:  # such as a file in one line, where `wall` has no lines of its own
        return dump(wanted)


def _spliced(loaded: Loaded, written: str) -> str:
    """The file's lines, those of `wall` replaced; comments before the next key stay with it."""
    lines = loaded.path.read_text(encoding="utf-8-sig").splitlines(keepends=True)
    starts = sorted(position.line - 1 for path, position in loaded.document.keys.items() if len(path) == 1)
    begin = loaded.document.keys[("wall",)].line - 1
    end = next((start for start in starts if start > begin), len(lines))
    while end > begin + 1 and end < len(lines) and (not lines[end - 1].strip() or lines[end - 1].startswith("#")):
        end -= 1
    return "".join(lines[:begin]) + written + "".join(lines[end:])
