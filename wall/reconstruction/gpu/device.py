"""The OpenGL context that a thread's pictures share, headless by EGL, and whether a real GPU is behind it.

The only file that imports moderngl, and it does so late: a wall without `reconstruction: gpu` never loads it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping
from glob import glob
from importlib.resources import files
from typing import Any

import numpy as np

from wall.core.colour import CURVE_STEPS
from wall.core.errors import RunError
from wall.deepbuffer.kernels.expire import AGE_SHIFT, AGES
from wall.deepbuffer.kernels.pixel_buffer import TILE
from wall.deepbuffer.kernels.reproject import FAR, NEAREST, OUTSIDE
from wall.reconstruction.kernels import visibility as seen
from wall.reconstruction.kernels.fill import TRUSTED
from wall.reconstruction.kernels.picture import FORGOTTEN
from wall.reconstruction.kernels.relight import NORMAL_STEPS

GROUP = 256  # invocations of a group
ROW = 32768  # groups in a row; OpenGL promises 65,535
OBJECT_WORDS = 14  # twelve of panel_from_object; whether that changed; whether that or its light did
LAMP_WORDS = 6  # see kernels_relight.lamp_tables
VERSION = 430  # of OpenGL: compute shaders and storage buffers
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software rasterizer", "swiftshader", "microsoft basic render")
NODES = ("/dev/dri/renderD*", "/dev/nvidia[0-9]*", "/dev/dxg", "/dev/kfd")  # where Linux shows a GPU
MOST_DEVICES = 16  # of EGL that are looked at

_COMPUTE = (
    "doubt", "relight", "place", "first", "nearest", "front", "ages", "oldest", "see", "halve", "expand", "resolve",
    "count", "scan", "pack", "shift", "leave", "display",
)  # fmt: skip
_FILLED = ("expand", "resolve")  # that look into the coarser level
_DRAWN = ("splat", "still")
_CONSTANTS: dict[str, int | np.float32] = {
    "GROUP": GROUP, "TILE": TILE, "AGES": AGES, "AGE_SHIFT": AGE_SHIFT, "FAR": FAR,
    "NEAREST": NEAREST, "OUTSIDE": OUTSIDE, "BEHIND": seen.BEHIND, "COVERS": seen.COVERS,
    "FORGOTTEN": FORGOTTEN,
    "SLOT": seen.SLOT, "AMIDST": seen.AMIDST, "ALONE": seen.ALONE, "WAITS": seen.WAITS, "RIM": seen.RIM,
    "CROWD": seen.CROWD, "SHARPEST": seen.SHARPEST, "SLOWEST": seen.SLOWEST,
    "NORMAL_STEPS": NORMAL_STEPS, "OBJECT_WORDS": OBJECT_WORDS, "LAMP_WORDS": LAMP_WORDS,
    "TRUSTED": TRUSTED, "CURVE_STEPS": np.float32(CURVE_STEPS),
}  # fmt: skip


class GpuError(RunError):
    """There is no GPU to reconstruct on, it is too small, or it gave up: `problem`, and what is wanted instead."""

    def __init__(self, problem: str, *, wanted: str) -> None:
        super().__init__(f"reconstruction: gpu: {problem}; wanted: {wanted}, or reconstruction: cpu")
        self.problem = problem


class Device:
    """One context and its programs; to be used by the thread that made it."""

    def __init__(self, context: Any) -> None:
        self.context = context
        context.gc_mode = "context_gc"  # a picture may be forgotten by another thread
        self.renderer = str(context.info["GL_RENDERER"])
        self.largest_buffer = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        self.largest_texture = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._compute = {name: context.compute_shader(_source(name)) for name in _COMPUTE}
        self._drawn = {name: self._vertices(name) for name in _DRAWN}

    @property
    def real(self) -> bool:
        """Whether this is more than a program on the CPU."""
        return is_real(self.renderer)

    def compute(
        self, name: str, count: int, buffers: tuple[Any, ...], *, groups: int | None = None, **uniforms: Any
    ) -> None:
        """Run a pass over `count` items with `buffers` bound in turn; what follows sees what it wrote."""
        shader = self._compute[name]
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        _set(shader, {"count": count, **uniforms})
        groups = -(-count // GROUP) if groups is None else groups
        shader.run(min(groups, ROW), -(-groups // ROW))
        self.context.memory_barrier()

    def draw(
        self, name: str, target: Any, vertices: tuple[int, int], buffers: tuple[Any, ...], **uniforms: Any
    ) -> None:
        """Add points (first, count) to a frame buffer, in their order."""
        vao = self._drawn[name]
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        _set(vao.program, uniforms)
        context = self.context
        target.use()
        context.enable_only(context.BLEND | context.PROGRAM_POINT_SIZE)
        context.blend_func = context.ONE, context.ONE
        vao.render(mode=context.POINTS, first=vertices[0], vertices=vertices[1])
        context.memory_barrier()

    def check(self) -> None:
        """Raise GpuError if anything has gone wrong since the last time."""
        error = self.context.error
        if error != "GL_NO_ERROR":
            raise GpuError(f"{self.renderer} reports {error}", wanted="a driver that goes on working")

    def _vertices(self, name: str) -> Any:
        stages = {f"{kind}_shader": _source(f"{name}.{kind[:4]}") for kind in ("vertex", "fragment")}
        return self.context.vertex_array(self.context.program(**stages), [])


def is_real(renderer: str) -> bool:
    """Whether an OpenGL renderer of this name is a GPU and not a program on the CPU."""
    return not any(name in renderer.lower() for name in SOFTWARE)


def gpu_nodes() -> list[str]:
    """Files of GPUs of this machine. Without one no driver need be loaded to know that there is none."""
    return sorted(path for pattern in NODES for path in glob(pattern))


_here = threading.local()
_opened_by: int | None = None  # process


def device() -> Device:
    """This thread's device: the first GPU of EGL's list, else software that does the same. Raises GpuError."""
    global _opened_by
    if _opened_by not in (None, os.getpid()):  # drivers do not survive a fork
        raise GpuError("OpenGL was opened before this process was forked", wanted="a process of its own")
    _opened_by = os.getpid()
    found: Device | None = getattr(_here, "device", None)
    if found is None:
        found = _here.device = Device(_open())
    found.context.gc()
    return found


def _open() -> Any:
    """A context on the first GPU, on software where there is none."""
    try:
        import moderngl
    except ImportError as error:
        raise GpuError(str(error), wanted="pip install moderngl") from error
    found: list[int] = []
    problems: list[str] = []
    for index in range(MOST_DEVICES):
        try:
            context = _context(moderngl, index)
        except Exception as error:  # moderngl raises nothing narrower
            problems.append(str(error))
            if "requested device index" in str(error):  # the list ends here
                break
            continue
        if is_real(str(context.info["GL_RENDERER"])):
            return context
        context.release()
        found.append(index)
    if found:
        return _context(moderngl, found[0])
    raise GpuError(f"EGL: {problems[0]}", wanted="a driver with OpenGL 4.3 and EGL")


def _context(moderngl: Any, index: int) -> Any:
    return moderngl.create_standalone_context(
        require=VERSION, backend="egl", device_index=index, libegl="libEGL.so.1", libgl="libGL.so.1"
    )


def _source(name: str) -> str:
    """A shader's text: version, constants of the CPU's kernels, what is shared, its own."""
    suffix = "" if "." in name else ".glsl"
    defines = "".join(f"#define {key} {_literal(value)}\n" for key, value in _CONSTANTS.items())
    parts = [] if suffix == "" else ["common.glsl"]
    if name in _FILLED:
        parts.append("between.glsl")
    folder = files(__package__) / "shaders"
    body = "".join((folder / part).read_text(encoding="utf-8") for part in [*parts, name + suffix])
    return f"#version {VERSION}\n{defines}#define NOWHERE 0xffffffffu\n{body}"


def _literal(value: int | np.float32) -> str:
    return repr(float(value)) if isinstance(value, np.floating) else str(value)


def _set(program: Any, uniforms: Mapping[str, Any]) -> None:
    for name, value in uniforms.items():
        if name in program:  # the compiler drops what a pass does not read
            program[name].value = value
