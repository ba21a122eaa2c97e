"""The `wall` command as a user types it: every shipped configuration, models, images, refusals, exit codes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from running import RUN_LIMIT_S, environment, mpirun, panels, summary, wall, write_config
from typer.testing import CliRunner

from wall import cli
from wall.config.loading import load
from wall.run import launch

CONFIGS = sorted((Path(__file__).parents[2] / "configs").rglob("*.yaml"))
TOO_LARGE = {"large"}  # 90 processes and 307 million pixels: drawn, checked and expanded by other tests
SHIPPED = [path for path in CONFIGS if path.parent.name != "measure" and path.stem not in TOO_LARGE]
# The others run as threads of one process, at a quarter of the cost: imports and kernels are loaded once
SECONDS = 0.1, 1.0, 3.0, 10.0  # of a run; those behind the first only on a machine so busy that it shows nothing
AS_PROCESSES = {"demo", "two_compositors", "mixed_sinks"}


@pytest.mark.parametrize("config", [path for path in SHIPPED if path.stem in AS_PROCESSES], ids=lambda path: path.stem)
def test_shipped_configurations_run_as_processes(tmp_path: Path, config: Path) -> None:
    def run(seconds: float) -> None:
        done = wall("run", config, "--headless", "--seconds", seconds, "--out", tmp_path)
        too_busy = seconds < SECONDS[-1] and "silent for" in done.stderr
        assert done.returncode == 0 or too_busy, done.stdout + done.stderr

    check_results(tmp_path, run)


@pytest.mark.parametrize("config", [path for path in SHIPPED if path.stem not in AS_PROCESSES], ids=lambda p: p.stem)
def test_shipped_configurations_run_as_threads(tmp_path: Path, config: Path) -> None:
    loaded = load(config)
    threads = loaded.config.transport.model_copy(update={"kind": "loopback"})
    loaded = loaded.with_config(loaded.config.model_copy(update={"transport": threads}))

    def run(seconds: float) -> None:
        options = launch.Options(out=tmp_path, headless=True, seconds=seconds)
        outcome = launch.run(loaded, options, say=print, opened=print)
        assert outcome is not None
        assert outcome.failed == ""

    check_results(tmp_path, run)


def check_results(folder: Path, run: Callable[[float], None]) -> None:
    """Run for so long until something is shown; nothing may be lost."""
    for seconds in SECONDS:
        run(seconds)
        if shows_something(folder):
            break
    assert summary(folder)["lost"] == {}
    assert shows_something(folder)


def shows_something(folder: Path) -> bool:
    """Whether samples came, and the picture of the wall, where one was written, is more than one colour."""
    path = folder / "wall.png"
    return summary(folder)["samples_shown"] > 0 and (not path.exists() or np.asarray(Image.open(path)).std() > 10)


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply", "stl"])
def test_model_of_the_users_own_is_framed_and_lit(tmp_path: Path, suffix: str) -> None:
    """The first by processes, the others by threads of this one."""
    model = tmp_path / f"ball.{suffix}"
    ball = trimesh.creation.icosphere(subdivisions=3, radius=70.0)
    ball.apply_translation([5000.0, -20.0, 1e5])
    ball.export(model)

    config = write_config(tmp_path, transport="zmq" if suffix == "glb" else "loopback")
    options = (config, "--scene", model, "--headless", "--until-complete", "--out", tmp_path / "out")
    if suffix == "glb":
        done = wall("run", *options)
        assert done.returncode == 0, done.stderr
    else:
        called = CliRunner().invoke(cli.app, ["run", *map(str, options)])
        assert called.exit_code == 0, called.output
    (image,) = panels(tmp_path / "out")
    middle, corner = image[24, 32].astype(int), image[1, 1].astype(int)
    assert np.abs(middle - corner).max() > 20, "the ball is not in the middle of the picture"
    assert 60 < middle.max() < 255, "neither black nor blown out"


def test_reference_image_has_the_same_bits_for_any_number_of_ranks_and_cores(tmp_path: Path) -> None:
    config = write_config(tmp_path)
    options = ("--spp", 5, "--size", "70x50", "--seed", 7)
    one_core = ("taskset", "-c", str(min(os.sched_getaffinity(0))))

    runs = {
        "core": wall("render", config, *options, "-o", tmp_path / "core.npy", launcher=one_core),
        "mpi": wall("render", config, *options, "-o", tmp_path / "mpi.npy", launcher=mpirun(3)),
    }
    assert all(done.returncode == 0 for done in runs.values()), [done.stderr for done in runs.values()]
    for name, seed in (("cores", 7), ("other", 8)):
        arguments = ["render", config, *options[:-1], seed, "-o", tmp_path / f"{name}.npy"]
        assert CliRunner().invoke(cli.app, list(map(str, arguments))).exit_code == 0

    images = {name: np.load(tmp_path / f"{name}.npy") for name in ("cores", "core", "mpi", "other")}
    assert images["cores"].shape == (50, 70, 3)
    assert images["cores"].dtype == np.float32
    assert np.array_equal(images["cores"], images["core"])
    assert np.array_equal(images["cores"], images["mpi"])
    assert not np.array_equal(images["cores"], images["other"]), "another seed, another picture"


def test_images_of_every_kind_hold_the_same_light(tmp_path: Path) -> None:
    import OpenEXR

    config = write_config(tmp_path)
    for kind in ("npy", "exr", "png"):
        done = CliRunner().invoke(cli.app, ["render", str(config), "--spp", "2", "-o", str(tmp_path / f"p.{kind}")])
        assert done.exit_code == 0, done.output
    linear = np.load(tmp_path / "p.npy")
    with OpenEXR.File(str(tmp_path / "p.exr")) as exr:
        np.testing.assert_array_equal(exr.channels()["RGB"].pixels, linear)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.clip(linear, 0, 1) ** (1 / 2.4) - 0.055)
    image = np.asarray(Image.open(tmp_path / "p.png")).astype(float)
    assert np.abs(image - np.clip(encoded, 0, 1) * 255).max() <= 0.5 + 1e-3


COUNTED = """\
import sys
from wall import cli
try:
    cli.main()
except SystemExit as ended:
    assert not ended.code
from wall.core.jit import specialisations
print("compiled:", *{name.split("(")[0] for name in specialisations()})
print("loaded:", *sys.modules)
"""
NOT_OF_BUILT_IN_SCENES = {"trimesh", "networkx", "scipy.linalg", "scipy.sparse", "scipy.spatial", "OpenEXR", "moderngl"}
NOT_OF_A_RATE = (
    "wall.reconstruction.", "wall.deepbuffer.", "wall.sampling.kernels.adaptive.", "wall.sampling.kernels.scores.",
)  # fmt: skip


def test_check_tells_ranks_features_and_rates_and_loads_only_what_it_measures(tmp_path: Path) -> None:
    config = str(write_config(tmp_path, columns=2, ranks=2))
    command = [sys.executable, "-c", COUNTED, "check", config]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=RUN_LIMIT_S, check=False)

    assert done.returncode == 0, done.stderr
    for words in (
        ": ok",
        "5 ranks",
        "mpirun --with-ft ulfm -x PATH -n 5",
        "head",
        "renderer",
        "smooth normals",
        "not in the scene, so neither compiled nor sent:",
        "reconstruction: ",
        "samples/s",
        "MB/s",
    ):
        assert words in " ".join(done.stdout.split()), words
    compiled, loaded = (line.split()[1:] for line in done.stdout.splitlines()[-2:])
    assert not NOT_OF_BUILT_IN_SCENES & set(loaded)
    assert "wall.tracing.kernels.trace.trace" in compiled
    assert not [name for name in compiled if name.startswith(NOT_OF_A_RATE)]


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Calls the command's entry point, which must end with exit code 2; gives what it said of why."""

    def call(*arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", ["wall", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        assert ended.value.code == 2
        return capsys.readouterr().err

    return call


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        ("refresh_hz: 30", "refresh_h: 30", "did you mean refresh_hz?"),
        ("columns: 1", "columns: none", "wall.grid.columns = 'none'"),
        ("source: courtyard", "source: castle", "scene.source = 'castle'"),
        ("source: courtyard", "source: missing.glb", "missing.glb: there is no such file"),
    ],
)
def test_refused_configuration_says_where(
    tmp_path: Path, refused: Callable[..., str], text: str, words: str, said: str
) -> None:
    config = write_config(tmp_path)
    config.write_text(config.read_text().replace(text, words), encoding="utf-8")

    for command, *options in (("check",), ("run", "--out", tmp_path / "out")):  # OUT may be another test's
        told = refused(command, config, *options)
        assert said in told
        assert config.name in told


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("render", "{config}", "-o", "picture.gif"), ".png, .exr, .npy"),
        (("render", "{config}", "--size", "big", "-o", "p.png"), "WIDTHxHEIGHT"),
        (("render", "nowhere.yaml", "-o", "p.png"), "nowhere.yaml"),
        (("run", "{config}", "--scene", "nowhere.obj"), "nowhere.obj"),
        (("run", "{config}", "--headless", "--out", "{config}"), "wanted a folder that can be written"),
        (("run", "{config}", "--scene", "{config}"), "yaml"),
    ],
)
def test_refused_arguments_say_why(
    tmp_path: Path, refused: Callable[..., str], arguments: tuple[str, ...], words: str
) -> None:
    config = str(write_config(tmp_path))
    assert words in refused(*(a.format(config=config) for a in arguments))


def test_refusal_ends_the_process_with_2_and_without_a_traceback(tmp_path: Path) -> None:
    done = wall("run", write_config(tmp_path, source="castle"))
    assert done.returncode == 2
    assert "scene.source = 'castle'" in done.stderr
    assert "Traceback" not in done.stderr


def test_help_teaches_every_command() -> None:
    done = wall("--help")
    assert done.returncode == 0
    for command in ("run", "render", "check", "measure", "schema"):
        assert command in done.stdout
    assert "mpirun" in wall("run", "--help").stdout
