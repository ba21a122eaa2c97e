"""The command line starts quickly: a command's libraries are loaded when the command runs."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version

from typer.testing import CliRunner

from wall import cli

SLOW_TO_IMPORT = ("numba", "numpy", "embreex", "matplotlib", "aiohttp", "pydantic", "ruamel", "zmq", "lxml", "lark")
HELP = """\
import sys
from wall import cli
try:
    cli.main()
except SystemExit as ended:
    assert not ended.code
print("loaded:", *sys.modules)
"""


def test_help_imports_no_command_and_none_of_its_libraries() -> None:
    done = subprocess.run([sys.executable, "-c", HELP, "--help"], capture_output=True, text=True, check=True)
    assert "screenshot" in done.stdout
    modules = done.stdout.splitlines()[-1].split()[1:]
    assert not set(SLOW_TO_IMPORT) & set(modules)
    ours = {name for name in modules if name.startswith("wall")}
    assert ours == {
        "wall",
        "wall.cli",
        "wall.cli_faults",
        "wall.cli_measure",
        "wall.cli_operations",
        "wall.cli_peers",
        "wall.cli_plan",
        "wall.cli_render",
        "wall.cli_tracker",
        "wall.core",
        "wall.core.errors",
        "wall.core.garbage",
        "wall.core.mpi",
        "wall.commands",
        "wall.commands.terminal",
    }


def test_asking_a_running_wall_takes_none_of_what_reads_configurations_or_runs_ranks() -> None:
    code = "import sys, wall.client, wall.commands.set; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "zmq" in loaded
    assert not {"pydantic", "ruamel", "embreex", "wall.config", "wall.roles", "wall.run.ports"} & loaded


def test_the_version_and_the_short_help_are_said() -> None:
    assert CliRunner().invoke(cli.app, ["--version"]).output == f"wall {version('wall')}\n"
    short, long = (CliRunner().invoke(cli.app, ["expand", option]).output for option in ("-h", "--help"))
    assert short == long
    assert "--output" in short
