"""The only file that touches Embree: the C API of the Embree 4.4 inside embreex, for Python and for kernels.

embreex's extension modules are linked against the Embree library they ship, so every `rtc*` symbol resolves
through one of them. Building scenes goes through ctypes; tracing goes through numba: the symbols' addresses are
registered with LLVM, so a nopython, nogil kernel calls `rtcIntersect16` directly and can still be cached on disk.
Source of names, numbers and layouts: Embree 4 API manual.
"""

from __future__ import annotations

import ctypes
import threading
import weakref
from functools import cache
from typing import Any, TypeAlias

import embreex.rtcore_scene
import llvmlite.binding as llvm
import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from wall.core.data import Float32
from wall.core.errors import RunError

PACKET = 16  # rays traced together; the widest packet Embree has
NO_HIT = 0xFFFFFFFF  # RTC_INVALID_GEOMETRY_ID

# where each row of 16 floats of a packet starts: RTCRay16 is the first 12 rows, RTCHit16 follows
ORIGIN_X, ORIGIN_Y, ORIGIN_Z, T_NEAR, DIRECTION_X, DIRECTION_Y, DIRECTION_Z, TIME = range(0, 128, 16)
T_FAR, MASK, RAY_ID, FLAGS = range(128, 192, 16)
NORMAL_X, NORMAL_Y, NORMAL_Z, HIT_U, HIT_V, PRIMITIVE, GEOMETRY, INSTANCE = range(192, 320, 16)
RAY_FLOATS, RAY_HIT_FLOATS = 192, 352  # two spare rows: Embree 4.4 writes an instance-array index behind INSTANCE

_GEOMETRY_TRIANGLE, _GEOMETRY_ROUND_LINEAR_CURVE, _GEOMETRY_SPHERES, _GEOMETRY_INSTANCE = 0, 16, 50, 121
_BUFFER_INDEX, _BUFFER_VERTEX = 0, 1
_FORMAT_UINT, _FORMAT_UINT3 = 0x5001, 0x5003
_FORMAT_FLOAT3, _FORMAT_FLOAT4, FORMAT_FLOAT3X4_ROW_MAJOR = 0x9003, 0x9004, 0x9134
_SCENE_DYNAMIC, _SCENE_ROBUST = 1, 4
_QUALITY_MEDIUM = 1  # low quality takes longer to build over instances, and is no faster to trace
_QUERY_COHERENT = 1 << 16
# triangles, curves, spheres, instances and filters, of what may be in a scene: Embree may skip tests for anything else
_FEATURES = (1 << 1) | (1 << 6) | (1 << 20) | (1 << 23) | (1 << 25)

_library = ctypes.CDLL(embreex.rtcore_scene.__file__)
_P, _U, _Z = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_P, [ctypes.c_char_p]),
    "rtcGetDeviceError": (ctypes.c_int, [_P]),
    "rtcNewScene": (_P, [_P]),
    "rtcReleaseScene": (None, [_P]),
    "rtcSetSceneFlags": (None, [_P, ctypes.c_int]),
    "rtcSetSceneBuildQuality": (None, [_P, ctypes.c_int]),
    "rtcCommitScene": (None, [_P]),
    "rtcNewGeometry": (_P, [_P, ctypes.c_int]),
    "rtcReleaseGeometry": (None, [_P]),
    "rtcCommitGeometry": (None, [_P]),
    "rtcAttachGeometryByID": (None, [_P, _P, _U]),
    "rtcSetSharedGeometryBuffer": (None, [_P, ctypes.c_int, _U, ctypes.c_int, _P, _Z, _Z, _Z]),
    "rtcSetGeometryInstancedScene": (None, [_P, _P]),
    "rtcSetGeometryUserData": (None, [_P, _P]),
    "rtcSetGeometryIntersectFilterFunction": (None, [_P, _P]),
    "rtcSetGeometryOccludedFilterFunction": (None, [_P, _P]),
    "rtcSetGeometryMask": (None, [_P, _U]),
    "rtcSetGeometryTransform": (None, [_P, _U, ctypes.c_int, _P]),
    "rtcIntersect16": (None, [_P, _P, _P, _P]),
    "rtcOccluded16": (None, [_P, _P, _P, _P]),
}
for _name, (_result, _arguments) in _SIGNATURES.items():
    _function = getattr(_library, _name)
    _function.restype, _function.argtypes = _result, _arguments


def _external(name: str, signature: Any) -> Any:
    """An Embree function that kernels can call by name (by ctypes where JIT is disabled)."""
    function = getattr(_library, name)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return lambda *arguments: function(*map(int, arguments))  # ctypes refuses NumPy's integers
    llvm.add_symbol(name, ctypes.cast(function, ctypes.c_void_p).value)
    return types.ExternalFunction(name, signature)


_PACKET_CALL = types.void(types.intp, types.intp, types.intp, types.intp)
intersect16 = _external("rtcIntersect16", _PACKET_CALL)  # (valid, scene, ray-hit packet, arguments)
occluded16 = _external("rtcOccluded16", _PACKET_CALL)  # (valid, scene, ray packet, arguments)
set_transform = _external("rtcSetGeometryTransform", types.void(types.intp, types.uint32, types.int32, types.intp))
commit_geometry = _external("rtcCommitGeometry", types.void(types.intp))

Handle: TypeAlias = int
Passing: TypeAlias = tuple[int, tuple[NDArray[Any], ...]]  # a filter of hits, see Device.mesh


def aligned(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """A zeroed array that starts on a 64-byte boundary, as 16-wide packets must."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    raw = np.zeros(size + 64, np.uint8)
    start = -raw.ctypes.data % 64
    rows: NDArray[Any] = raw[start : start + size].view(dtype).reshape(shape)
    return rows


def query_arguments(*, coherent: bool) -> NDArray[np.uint32]:
    """RTCIntersectArguments: query flags and feature mask, then null pointers."""
    arguments = aligned((16,), np.uint32)
    arguments[1] = _FEATURES
    expect(arguments, coherent=coherent)
    return arguments


def expect(arguments: NDArray[np.uint32], *, coherent: bool) -> None:
    """Tell Embree in `query_arguments` whether the rays of a packet go the same way."""
    arguments[0] = _QUERY_COHERENT if coherent else 0


_making = threading.Lock()


def _the_device() -> Handle:
    """The process's only one, never released: beside a second one an idle thread of Embree's pool spins for ever."""
    with _making:
        return _make_device()


@cache
def _make_device() -> Handle:
    handle: Handle = _library.rtcNewDevice(b"threads=1")  # to build with; tracing runs in the caller's threads
    if not handle:
        raise RunError(f"Embree refused to start: error {_library.rtcGetDeviceError(None)}")
    return handle


class Device:
    """Meshes of the process's Embree device, released together."""

    def __init__(self) -> None:
        self.handle = _the_device()
        self._scenes: list[Handle] = []
        self._kept: list[NDArray[Any]] = []
        end = weakref.finalize(self, _release, self._scenes, [], self._kept)
        end.atexit = False  # threads may still trace then

    def check(self, doing: str) -> None:
        """Raises RunError if Embree met an error; `doing` is what it was asked for."""
        error = _library.rtcGetDeviceError(self.handle)
        if error:
            raise RunError(
                f"Embree failed while {doing}: error {error} (2: bad argument, 3: bad operation, 4: out of memory)"
            )

    def mesh(self, vertices: Float32, triangles: NDArray[np.uint32], passing: Passing | None = None) -> Handle:
        """A committed, robust scene of one triangle mesh.

        Parameters
        ----------
        vertices : (v, 3) float32, contiguous, kept alive here; the 16 bytes behind the last one must be readable
        triangles : (t, 3) uint32, contiguous
        passing : address of a filter of hits (RTCFilterFunctionN), what it gets as user data, and arrays that this
            points to, kept alive here; None: every hit counts
        """
        geometry = _library.rtcNewGeometry(self.handle, _GEOMETRY_TRIANGLE)
        _library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_VERTEX, 0, _FORMAT_FLOAT3, vertices.ctypes.data, 0, 12, len(vertices)
        )
        _library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_INDEX, 0, _FORMAT_UINT3, triangles.ctypes.data, 0, 12, len(triangles)
        )
        self._kept += [vertices, triangles]
        return self._alone(geometry, passing, "building a mesh")

    def spheres(self, spheres: Float32, passing: Passing | None = None) -> Handle:
        """A committed, robust scene of spheres; the normals of their hits point outwards.

        Parameters
        ----------
        spheres : (n, 4) float32, contiguous, centres and radii, kept alive here
        passing : as for `mesh`
        """
        geometry = _library.rtcNewGeometry(self.handle, _GEOMETRY_SPHERES)
        _library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_VERTEX, 0, _FORMAT_FLOAT4, spheres.ctypes.data, 0, 16, len(spheres)
        )
        self._kept.append(spheres)
        return self._alone(geometry, passing, "building spheres")

    def curves(self, spheres: Float32, segments: NDArray[np.uint32], passing: Passing | None = None) -> Handle:
        """A committed, robust scene of curves: cones between spheres that follow each other, without seams.

        Parameters
        ----------
        spheres : (v, 4) float32, contiguous, centres and radii, kept alive here
        segments : (s,) uint32, contiguous, of the first of each two spheres; kept alive here
        passing : as for `mesh`
        """
        geometry = _library.rtcNewGeometry(self.handle, _GEOMETRY_ROUND_LINEAR_CURVE)
        _library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_VERTEX, 0, _FORMAT_FLOAT4, spheres.ctypes.data, 0, 16, len(spheres)
        )
        _library.rtcSetSharedGeometryBuffer(
            geometry, _BUFFER_INDEX, 0, _FORMAT_UINT, segments.ctypes.data, 0, 4, len(segments)
        )
        self._kept += [spheres, segments]
        return self._alone(geometry, passing, "building curves")

    def _alone(self, geometry: Handle, passing: Passing | None, doing: str) -> Handle:
        """A committed, robust scene of one geometry, which it takes; `doing`: see check."""
        if passing is not None:
            _library.rtcSetGeometryUserData(geometry, passing[1][0].ctypes.data)
            _library.rtcSetGeometryIntersectFilterFunction(geometry, passing[0])
            _library.rtcSetGeometryOccludedFilterFunction(geometry, passing[0])
            self._kept += passing[1]
        _library.rtcCommitGeometry(geometry)
        scene = _new_scene(self.handle, _SCENE_ROBUST, _QUALITY_MEDIUM)
        self._scenes.append(scene)
        _library.rtcAttachGeometryByID(scene, geometry, 0)
        _library.rtcReleaseGeometry(geometry)
        _library.rtcCommitScene(scene)
        self.check(doing)
        return scene

    def tree(self, of: Handles) -> Handle:
        """A scene for instances, empty, to be committed; it is kept in `of`, which releases it."""
        scene = _new_scene(self.handle, _SCENE_ROBUST | _SCENE_DYNAMIC, _QUALITY_MEDIUM)
        of.scenes.append(scene)
        return scene

    def instance(self, of: Handles, scene: Handle, number: int, *, mesh: Handle, mask: int) -> Handle:
        """An instance of a mesh that has this number in hits of `scene`; a ray passes it without a bit of its mask."""
        geometry: Handle = _library.rtcNewGeometry(self.handle, _GEOMETRY_INSTANCE)
        _library.rtcSetGeometryInstancedScene(geometry, mesh)
        _library.rtcSetGeometryMask(geometry, mask)
        _library.rtcAttachGeometryByID(scene, geometry, number)
        of.geometries.append(geometry)
        return geometry

    def show(self, geometry: Handle, mesh: Handle) -> None:
        """Make an instance one of another mesh, once its scene is committed."""
        _library.rtcSetGeometryInstancedScene(geometry, mesh)
        _library.rtcCommitGeometry(geometry)

    def mask(self, geometry: Handle, mask: int) -> None:
        """Let rays without a bit of the mask pass an instance, once its scene is committed; 0: all rays."""
        _library.rtcSetGeometryMask(geometry, mask)
        _library.rtcCommitGeometry(geometry)

    def commit(self, scene: Handle) -> None:
        """Build a tree over the instances of a scene."""
        _library.rtcCommitScene(scene)

    def handles(self) -> Handles:
        """Room for instances that are released with what is returned, not with this device."""
        return Handles(self)


class Handles:
    """Embree's handles of instances and their scenes, released with this object; keeps the devices of their meshes."""

    def __init__(self, device: Device) -> None:
        self.scenes: list[Handle] = []
        self.geometries: list[Handle] = []
        self.devices = [device]
        end = weakref.finalize(self, _release, self.scenes, self.geometries, self.devices)
        end.atexit = False


def _new_scene(device: Handle, flags: int, quality: int) -> Handle:
    scene: Handle = _library.rtcNewScene(device)
    _library.rtcSetSceneFlags(scene, flags)
    _library.rtcSetSceneBuildQuality(scene, quality)
    return scene


def _release(scenes: list[Handle], geometries: list[Handle], kept: list[Any]) -> None:
    """Releases Embree's handles, then the arrays that Embree shared."""
    for geometry in geometries:
        _library.rtcReleaseGeometry(geometry)
    for scene in reversed(scenes):
        _library.rtcReleaseScene(scene)
    kept.clear()  # only now may vertices go
