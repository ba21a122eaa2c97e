"""Where images are made: `auto` takes a real GPU only and says why not, `gpu` insists."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from wall.reconstruction import choice
from wall.reconstruction.gpu import device
from wall.reconstruction.gpu.device import Device, is_real
from wall.reconstruction.reconstruction import Reconstruction


@pytest.mark.parametrize(
    "renderer",
    [
        "llvmpipe (LLVM 15.0.6, 256 bits)",
        "softpipe",
        "Software Rasterizer",
        "Google SwiftShader",
        "ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader driver)",
        "D3D12 (Microsoft Basic Render Driver)",
    ],
)
def test_a_program_on_the_cpu_is_no_real_gpu(renderer: str) -> None:
    assert not is_real(renderer)


@pytest.mark.parametrize(
    "renderer",
    [
        "NVIDIA H200/PCIe/SSE2",
        "NVIDIA GeForce RTX 4090/PCIe/SSE2",
        "AMD Radeon RX 7900 XTX (radeonsi, navi31, LLVM 15.0.6, DRM 3.54)",
        "Mesa Intel(R) Arc(tm) A770 Graphics (DG2)",
    ],
)
def test_gpus_are_real(renderer: str) -> None:
    assert is_real(renderer)


def test_auto_opens_no_driver_where_the_machine_shows_no_gpu(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(device, "NODES", (str(tmp_path / "renderD*"),))
    assert str(choice.choose("auto")) == "cpu (this machine has no GPU)"


def test_auto_leaves_software_alone_and_says_so(
    opengl: Device, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    node = tmp_path / "renderD128"
    node.touch()
    monkeypatch.setattr(device, "NODES", (str(node),))
    chosen = choice.choose("auto")
    assert chosen.on == ("gpu" if opengl.real else "cpu")
    assert opengl.renderer in chosen.why


def test_gpu_takes_software_too(opengl: Device) -> None:
    assert choice.choose("gpu") == choice.Choice(on="gpu", why=opengl.renderer)


def test_cpu_is_never_asked_twice() -> None:
    assert choice.choose("cpu").on == "cpu"


def without_drivers(code: str) -> subprocess.CompletedProcess[str]:
    """A process in which libglvnd finds no driver, as on a machine that has none."""
    hidden = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/none", "__EGL_VENDOR_LIBRARY_DIRS": "/none"}
    environment = {**os.environ, **hidden}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=100)


def test_gpu_without_a_driver_is_refused_with_the_reason_and_what_would_do() -> None:
    done = without_drivers("from wall.reconstruction.choice import choose; choose('gpu')")
    last = done.stderr.strip().splitlines()[-1]
    assert done.returncode == 1
    assert "GpuError: reconstruction: gpu: " in last
    assert last.endswith("; wanted: a driver with OpenGL 4.3 and EGL, or reconstruction: cpu")


def test_auto_without_a_driver_is_the_cpu_and_says_why(tmp_path: Path) -> None:
    (tmp_path / "renderD128").touch()
    done = without_drivers(
        "from wall.reconstruction.gpu import device\n"
        "from wall.reconstruction.choice import choose\n"
        f"device.NODES = ({str(tmp_path / 'renderD128')!r},)\n"
        "print(choose('auto'))"
    )
    assert done.stdout.startswith("cpu (EGL"), done.stderr


def test_a_forked_process_does_not_touch_its_parents_opengl(opengl: Device) -> None:
    """Drivers do not survive a fork: the child must say so and not hang."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            choice.choose("gpu")
            os.write(writing, b"took it")
        except device.GpuError as error:
            os.write(writing, error.problem.encode())
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    os.close(writing)
    assert b"before this process was forked" in os.read(reading, 1000)
    os.close(reading)


def test_moderngl_is_not_loaded_where_nobody_asks_for_a_gpu() -> None:
    code = "import sys, wall.roles.layer; assert 'moderngl' not in sys.modules, 'loaded'"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr


def test_a_panel_that_is_too_large_for_the_gpu_is_refused_or_left_to_the_cpu(
    opengl: Device, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from adaptive_images import FRONT, plate_before_wall

    monkeypatch.setattr(opengl, "largest_buffer", 1 << 16)
    scene = plate_before_wall((0.0, 0.0, 2.0))
    with pytest.raises(device.GpuError, match=r"samples take \d+ bytes in one buffer, .* has 65536; wanted: smaller"):
        choice.make_reconstruction("gpu", FRONT.panel, FRONT.eye, scene, samples_per_pixel=4.0)
    (tmp_path / "renderD128").touch()
    monkeypatch.setattr(device, "NODES", (str(tmp_path / "renderD128"),))
    monkeypatch.setattr(device, "SOFTWARE", ())  # whatever there is counts as a GPU
    made, _, chosen = choice.make_reconstruction("auto", FRONT.panel, FRONT.eye, scene, samples_per_pixel=4.0)
    assert isinstance(made, Reconstruction)
    assert chosen.on == "cpu"
    assert "in one buffer" in chosen.why
