"""Builds the documentation as a site: README, docs/ and configs/ as they are, and two pages made from the program.

    python docs/build_site.py FOLDER     # FOLDER/source/ is what is built, FOLDER/site/index.html the site

Broken links and anchors end it with an error (exit code 1).
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wall.config.json_schema import accepted, schema

ROOT = Path(__file__).parents[1]
COPIED = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff", "docs", "configs")
LONGEST = 60  # characters of a default that is shown


def build(folder: Path) -> int:
    """Stage the pages in a folder and build the site there; the exit code of the generator."""
    source = folder / "source"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    for name in COPIED:
        path = ROOT / name
        if path.is_dir():
            shutil.copytree(path, source / name, ignore=shutil.ignore_patterns("*.py", "*.toml", "__pycache__"))
        else:
            shutil.copy(path, source / name)
    for page in source.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        unnamed = re.sub(r"^```(\w+) .*$", r"```\1", text, flags=re.MULTILINE)  # blocks with a name are not known
        page.write_text(unnamed, encoding="utf-8")
    shutil.copy(ROOT / "docs/site.toml", folder / "zensical.toml")
    reference = source / "docs/reference"
    reference.mkdir()
    (reference / "configuration.md").write_text("\n".join(configuration_page(schema())), encoding="utf-8")
    (reference / "commands.md").write_text(commands_page(), encoding="utf-8")
    return subprocess.run([sys.executable, "-m", "zensical", "build", "--clean", "--strict"], cwd=folder).returncode


def commands_page() -> str:
    """Every command with its options, as `wall COMMAND --help` has them."""
    command = [sys.executable, "-m", "typer", "wall.cli", "utils", "docs", "--name", "wall", "--title", "Commands"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return re.sub(r"</?span[^>]*>", "`", text)  # bold in a terminal


def configuration_page(whole: dict[str, Any]) -> Iterator[str]:
    """Lines of a page with a table for each section of the configuration's schema, the whole file first."""
    yield "# Configuration: every key"
    yield ""
    yield "Made from the schema that checks configurations; [Configuration](../guide/configuration.md) explains them."
    yield from table("The file", whole)
    for name, section in sorted(whole["$defs"].items()):
        if "properties" in section:
            yield from table(name, section)


def table(name: str, section: dict[str, Any]) -> Iterator[str]:
    """A section's heading, description and keys."""
    yield from ("", f"## {name}", "", section.get("description", ""), "")
    yield from ("| key | is | default | |", "|---|---|---|---|")
    required = section.get("required", ())
    for key, field in section["properties"].items():
        default = "required" if key in required else shown(field.get("default"))
        cells = (f"`{key}`", kind(field), default, field.get("description", ""))
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"


def kind(field: dict[str, Any]) -> str:
    """What a key takes, in the words of error messages; sections are linked."""
    names = [each["$ref"].rsplit("/", 1)[-1] for each in nested(field) if "$ref" in each]
    links = ", ".join(f"[{name}](#{name.lower()})" for name in dict.fromkeys(names))
    if not links:
        return accepted({key: value for key, value in field.items() if key != "description"})
    return f"list of {links}" if "items" in field else links


def nested(field: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A field's schema and those inside it, of choices and of lists."""
    yield field
    inner = [*field.get("anyOf", ()), *field.get("oneOf", ()), *field.get("prefixItems", ())]
    for each in [*inner, *([field["items"]] if isinstance(field.get("items"), dict) else [])]:
        yield from nested(each)


def shown(default: Any) -> str:
    """A default as YAML; long ones are left out."""
    text = json.dumps(default)
    return "" if default is None or len(text) > LONGEST else f"`{text}`"


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1]).resolve()))
