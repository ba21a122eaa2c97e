"""What the commands print: texts from outside as they are, and to whoever still listens."""

from __future__ import annotations

import io
import os
import subprocess
import sys

import pytest
from rich.table import Table

from wall.commands.terminal import Terminal

HOSTILE = "OUT[bold]:smile:[/]\x1b[31m\x07\x9b2J\r"
SPELLED = "OUT[bold]:smile:[/]\\x1b[31m\\x07\\x9b2J\\x0d"


def test_text_from_outside_is_shown_as_it_is_and_cannot_steer_the_terminal() -> None:
    out = io.StringIO()
    table = Table("name", title=HOSTILE)
    table.add_row(HOSTILE)
    terminal = Terminal(file=out, width=200, force_terminal=True, color_system=None)
    terminal.print(HOSTILE)
    terminal.print(table)
    assert out.getvalue().count(SPELLED) == 3
    assert not set(out.getvalue()) & {"\x07", "\x9b", "\r"}
    assert "\x1b[31m" not in out.getvalue()


@pytest.mark.parametrize("full", [False, True])
def test_what_nobody_takes_is_not_printed_and_stops_nothing(full: bool) -> None:
    code = "from wall.commands.terminal import console\nfor _ in range(3): console.print('x' * 100000)"
    code += "\nimport sys; sys.stderr.write('went on')"
    if full:
        with open("/dev/full", "w") as out:
            done = subprocess.run(
                [sys.executable, "-c", code], stdout=out, stderr=subprocess.PIPE, text=True, check=True
            )
    else:
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "w") as out:
            done = subprocess.run(
                [sys.executable, "-c", code], stdout=out, stderr=subprocess.PIPE, text=True, check=True
            )
    assert done.stderr == "went on"


def test_files_that_are_opened_are_not_taken_for_closed_streams() -> None:
    code = "import os\nfor k in range(3): os.close(k)\nfrom wall.commands import terminal\n"
    code += "terminal.open_standard_streams()\nos._exit(os.open(os.devnull, os.O_RDONLY))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 3
