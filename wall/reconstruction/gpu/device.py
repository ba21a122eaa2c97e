"""The OpenGL context that a thread's images share, headless by EGL, and whether a real GPU is behind it.

The only file that imports moderngl, and it does so late: a wall without `reconstruction: gpu` never loads it.
"""

from __future__ import annotations

import os
import threading
from glob import glob
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wall.core.colour import CURVE_STEPS
from wall.core.errors import RunError
from wall.deepbuffer.kernels.accumulation import AROUND, BITS, MEAN_ALONE
from wall.deepbuffer.kernels.change import LEAST_CONFIDENCE, REACH, SHARE_AT, TRUSTED
from wall.deepbuffer.kernels.columns import DEPTH, X, Y, Z
from wall.deepbuffer.kernels.cuts import NEAR
from wall.deepbuffer.kernels.doubt import KEPT, LEAST
from wall.deepbuffer.kernels.evict import AGE_SHIFT, AGES
from wall.deepbuffer.kernels.lights import LEAST_SQUARE, NORMAL_STEPS
from wall.deepbuffer.kernels.reproject import FAR, NEAREST, OUTSIDE
from wall.reconstruction.kernels import visibility
from wall.reconstruction.reconstruction import SLOW_DECAY

WORD_BYTES = 4
GROUP = 256  # invocations of a group
ROW = 32768  # groups in a row; OpenGL promises 65,535
MOVED, CHANGED = 12, 13  # words of an object after panel_from_object: it moved; it moved or its light changed
OBJECT_WORDS = 14
LIGHT_WORDS = 6  # see deepbuffer.kernels.lights.light_tables
TIME, CONFIDENCE = 0, 1  # words of a sample in `state`
NORMAL, VISIBILITY = 0, 1  # words of a sample in `surface`
VERSION = 430  # of OpenGL: compute shaders and storage buffers
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software rasterizer", "swiftshader", "microsoft basic render")
NODES = ("/dev/dri/renderD*", "/dev/nvidia[0-9]*", "/dev/dxg", "/dev/kfd")  # where Linux shows a GPU
MOST_DEVICES = 16  # of EGL that are looked at

_COMPUTE = (
    "mark_contradicted", "relight", "reproject", "nearest_slot", "nearest", "gaps", "bound_depths", "ages", "cutoff",
    "weigh", "halve", "expand", "resolve", "merge", "count", "scan", "pack", "shift", "evict", "display",
    "doubt", "cut_away", "splat", "collect", "accumulate", "unload", "surfaces", "newest_times",
    "channels", "blank",
)  # fmt: skip
_INTERPOLATING = ("expand", "resolve")  # read the coarser level
_ADDING = ("splat", "accumulate")  # to sums of pixels
_FLOAT_ATOMICS = "GL_NV_shader_atomic_float"  # of Mesa's drivers too
_CONSTANTS: dict[str, int | np.float32] = {
    "GROUP": GROUP, "AGES": AGES, "AGE_SHIFT": AGE_SHIFT, "X": X, "Y": Y, "Z": Z, "DEPTH": DEPTH, "TIME": TIME,
    "CONFIDENCE": CONFIDENCE, "NORMAL": NORMAL, "VISIBILITY": VISIBILITY, "MOVED": MOVED, "CHANGED": CHANGED,
    "OBJECT_WORDS": OBJECT_WORDS, "LIGHT_WORDS": LIGHT_WORDS, "FAR": FAR, "NEAREST": NEAREST, "OUTSIDE": OUTSIDE,
    "LEAST_CONFIDENCE": LEAST_CONFIDENCE, "NORMAL_STEPS": NORMAL_STEPS, "LEAST_SQUARE": LEAST_SQUARE,
    "TRUSTED": TRUSTED, "SLOW_DECAY": np.float32(SLOW_DECAY), "CURVE_STEPS": np.float32(CURVE_STEPS),
    "MEAN_ALONE": MEAN_ALONE, "AROUND": AROUND, "REACH": REACH,
    "DOUBT_KEPT": KEPT, "DOUBT_LEAST": LEAST, "CUT_NEAR": NEAR,
    **{
        name: getattr(visibility, name)
        for name in (
            "COVERS", "SLOT", "EMPTY", "AMIDST", "ALONE", "WAIT_S", "SILHOUETTE_PER_S", "DENSE", "SHARPEST", "SLOWEST",
        )
    },
}  # fmt: skip
_WORDS = {
    "NOWHERE": "0xffffffffu", "INFINITY_BITS": "0x7f800000u", "SUMS": "0", "CHANNELS": "4u",
    "OBJECT_BITS": f"{BITS}u", "SHARES": f"float[]({', '.join(map(repr, SHARE_AT.ravel().tolist()))})",
}  # fmt: skip


class GpuError(RunError):
    """There is no GPU to reconstruct on, it is too small, or it gave up: `problem`, and what is wanted instead."""

    def __init__(self, problem: str, *, wanted: str) -> None:
        super().__init__(f"reconstruction: gpu: {problem}; wanted: {wanted}, or reconstruction: cpu")
        self.problem = problem


class Device:
    """One context and its programs; to be used by the thread that made it."""

    def __init__(self, context: Any, *, float_atomics: bool = True) -> None:
        """`float_atomics`: used where the driver has them."""
        self.context = context
        context.gc_mode = "context_gc"  # an image may be forgotten by another thread
        self.renderer = str(context.info["GL_RENDERER"])
        self.largest_buffer = int(context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        self.largest_texture = int(context.info["GL_MAX_TEXTURE_SIZE"])
        adds = float_atomics and _FLOAT_ATOMICS in context.extensions
        self._compute = {name: context.compute_shader(_source(name, float_atomics=adds)) for name in _COMPUTE}
        self._uniforms = {name: dict[str, Any]() for name in _COMPUTE}  # of each pass, as they were set last
        self._passes = False  # what was asked for last is a pass

    @property
    def real(self) -> bool:
        """Whether this is more than a program on the CPU."""
        return is_real(self.renderer)

    def compute(
        self, name: str, count: int, buffers: tuple[Any, ...], *, groups: int | None = None, **uniforms: Any
    ) -> None:
        """Run a pass over `count` items with `buffers` bound in turn; what follows sees what it wrote."""
        self._turn_to(passes=True)
        shader, known = self._compute[name], self._uniforms[name]
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
        for key, value in {"count": count, **uniforms}.items():
            if known.get(key) != value:
                if key in shader:  # the compiler drops what a pass does not read
                    shader[key].value = value
                known[key] = value
        groups = -(-count // GROUP) if groups is None else groups
        shader.run(min(groups, ROW), -(-groups // ROW))
        self.context.memory_barrier()

    def buffer(self, values: NDArray[Any]) -> Any:
        """A buffer of these values."""
        self._turn_to(passes=False)
        return self.context.buffer(np.ascontiguousarray(values))

    def reserve(self, words: int) -> Any:
        """A buffer of 4-byte words, of any values. Raises GpuError where memory ends."""
        self._turn_to(passes=False)
        try:
            return self.context.buffer(reserve=max(words, 1) * WORD_BYTES)
        except Exception as error:  # moderngl raises nothing narrower
            problem = f"{words * WORD_BYTES} bytes on {self.renderer}: {error}"
            raise GpuError(problem, wanted="smaller panels, fewer samples_per_pixel") from error

    def write(self, target: Any, values: NDArray[Any], **place: int) -> None:
        """Write to a buffer, from byte `offset` on, or to a texture."""
        self._turn_to(passes=False)
        target.write(np.ascontiguousarray(values), **place)

    def read(self, texture: Any, out: NDArray[Any]) -> None:
        """Fill `out`, contiguous, with a texture's values."""
        self._turn_to(passes=False)
        texture.read_into(out, alignment=1)

    def _turn_to(self, *, passes: bool) -> None:
        """Wait where a pass follows what is none, or the other way round, until all that was asked for is done.

        OpenGL promises that order, but an NVIDIA H100 (driver 580.159, EGL) did not keep it: see decision 73.
        """
        if passes != self._passes:
            self.context.finish()
            self._passes = passes

    def check(self) -> None:
        """Raise GpuError if anything has gone wrong since the last time."""
        error = self.context.error
        if error != "GL_NO_ERROR":
            raise GpuError(f"{self.renderer} reports {error}", wanted="a driver that goes on working")


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


def _source(name: str, *, float_atomics: bool) -> str:
    """A shader's text: version, constants of the CPU's kernels, what is shared, its own."""
    values = {key: _literal(value) for key, value in _CONSTANTS.items()} | _WORDS
    defines = "".join(f"#define {key} {value}\n" for key, value in values.items())
    parts = ["common.glsl"]
    if name in _INTERPOLATING:
        parts.append("interpolate.glsl")
    if name in _ADDING:
        parts.append("add.glsl")
        if float_atomics:
            defines = f"#extension {_FLOAT_ATOMICS} : require\n#define FLOAT_ATOMICS\n{defines}"
    folder = files(__package__) / "shaders"
    body = "".join((folder / part).read_text(encoding="utf-8") for part in [*parts, f"{name}.glsl"])
    return f"#version {VERSION}\n{defines}{body}"


def _literal(value: int | np.float32) -> str:
    return repr(float(value)) if isinstance(value, np.floating) else str(value)
