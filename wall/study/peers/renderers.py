"""Other renderers, each drawing the same triangles from a camera into memory. Loaded in processes of their own.

Each is used as its own examples do for pictures off the screen, its settings left as they come, but for what would
change colours. OpenGL is Mesa's software renderer: all of them have the same cores and nothing else.
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from wall.core.colour import srgb_codes, srgb_decoded
from wall.core.data import Float64
from wall.core.errors import RunError
from wall.study.mitsuba.library import libllvm
from wall.study.peers.drawing import Codes, Triangles

SOFTWARE = {  # what a process is started with
    "EGL_PLATFORM": "surfaceless",
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "OPEN3D_CPU_RENDERING": "true",
    "VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow",
}
NEAR, FAR = 1e-3, 4.0  # of what Open3D draws, in radii of the scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where a camera is."""

    origin: Float64  # (3,) world
    rotation: Float64  # (3, 3) world from camera: right, up, back

    @property
    def target(self) -> Float64:
        """(3,) world, a point ahead."""
        return self.origin - self.rotation[:, 2]


class Peer(Protocol):
    """Another renderer, which has the triangles."""

    device: str  # what draws

    def draw(self, pose: Pose) -> Codes:
        """(h, w, 3) uint8 sRGB, in memory and complete."""


class PyVista:
    """VTK by PyVista's plotter, off the screen."""

    def __init__(self, triangles: Triangles, size: tuple[int, int], fov: float) -> None:
        pyvista, vtk = (importlib.import_module(name) for name in ("pyvista", "vtkmodules.vtkCommonCore"))
        self._size, self._fov = size, fov
        self._plotter = pyvista.Plotter(off_screen=True, window_size=list(size), lighting="none")
        faces = np.insert(triangles.corners, 0, 3, axis=1)
        mesh = pyvista.PolyData(triangles.positions, faces.ravel())
        mesh.point_data["color"] = triangles.codes
        self._plotter.add_mesh(mesh, scalars="color", rgb=True, lighting=False)
        self._plotter.set_background("white")
        self._plotter.show(auto_close=False)
        self._window, self._codes = self._plotter.render_window, vtk.vtkUnsignedCharArray()
        said = self._window.ReportCapabilities().splitlines()
        self.device = next((line.partition(":")[2].strip() for line in said if "renderer string" in line), "OpenGL")

    def draw(self, pose: Pose) -> Codes:
        """(h, w, 3) uint8 sRGB."""
        camera, (width, height) = self._plotter.camera, self._size
        camera.SetPosition(pose.origin)
        camera.SetFocalPoint(pose.target)
        camera.SetViewUp(pose.rotation[:, 1])
        camera.SetViewAngle(self._fov)
        self._plotter.renderer.ResetCameraClippingRange()
        self._window.Render()
        self._window.GetPixelData(0, 0, width - 1, height - 1, 0, self._codes, 0)
        found: Codes = np.asarray(self._codes, np.uint8).reshape(height, width, 3)[::-1].copy()
        return found


class Open3D:
    """Filament by Open3D's renderer off the screen, which hands images over from the last row to the first."""

    def __init__(self, triangles: Triangles, size: tuple[int, int], fov: float) -> None:
        open3d: Any = importlib.import_module("open3d")
        rendering = open3d.visualization.rendering
        open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
        self._renderer, self._fov, self._size = rendering.OffscreenRenderer(*size), fov, size
        mesh = open3d.geometry.TriangleMesh(
            open3d.utility.Vector3dVector(triangles.positions.astype(np.float64)),
            open3d.utility.Vector3iVector(triangles.corners),
        )
        mesh.vertex_colors = open3d.utility.Vector3dVector(triangles.codes / 255.0)
        material = rendering.MaterialRecord()
        material.shader = "defaultUnlit"
        scene = self._renderer.scene
        scene.add_geometry("triangles", mesh, material)
        scene.set_background([1.0, 1.0, 1.0, 1.0])
        scene.view.set_post_processing(False)  # it would map tones
        low, high = triangles.positions.min(axis=0), triangles.positions.max(axis=0)
        self._middle, self._radius = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0
        self._plain = rendering.Camera.FovType.Vertical
        self.device = "Filament on Mesa's software OpenGL"

    def draw(self, pose: Pose) -> Codes:
        """(h, w, 3) uint8 sRGB."""
        camera = self._renderer.scene.camera
        far = float(np.linalg.norm(pose.origin - self._middle)) + self._radius
        camera.set_projection(self._fov, self._size[0] / self._size[1], NEAR * self._radius, far, self._plain)
        camera.look_at(pose.target, pose.origin, pose.rotation[:, 1])
        return np.asarray(self._renderer.render_to_image())[..., :3].copy()


class Mitsuba:
    """Mitsuba 3 with LLVM, one sample a pixel, and an integrator that sees the colours of triangles and nothing else.

    That is its own way to extend it, and the least that it can do. Its lamps shine to one side, its `direct` light
    has shadows: neither would draw the same.
    """

    def __init__(self, triangles: Triangles, size: tuple[int, int], fov: float) -> None:
        library = libllvm()
        if library is None:
            raise RunError("Mitsuba finds no libLLVM that it can use (Debian: apt install libllvm19)")
        os.environ["DRJIT_LIBLLVM_PATH"] = library
        drjit, mitsuba = (importlib.import_module(name) for name in ("drjit", "mitsuba"))
        mitsuba.set_variant("llvm_ad_rgb")
        drjit.set_thread_count(len(os.sched_getaffinity(0)))
        self.device, self._mi, self._number = str(mitsuba.variant()), mitsuba, 0
        properties = mitsuba.Properties()
        properties["bsdf"] = mitsuba.load_dict({"type": "twosided", "bsdf": {"type": "diffuse"}})
        mesh = mitsuba.Mesh("triangles", len(triangles.positions), len(triangles.corners), props=properties)
        mesh.add_attribute("vertex_color", 3, srgb_decoded(triangles.codes.astype(np.float32) / 255.0).ravel())
        values = mitsuba.traverse(mesh)
        values["vertex_positions"], values["faces"] = triangles.positions.ravel(), triangles.corners.ravel()
        values.update()
        film = {
            "type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}, "pixel_format": "rgb",
        }  # fmt: skip
        self._scene = mitsuba.load_dict({
            "type": "scene", "triangles": mesh,
            "sensor": {"type": "perspective", "fov": fov, "fov_axis": "y", "film": film, "near_clip": 1e-3},
        })  # fmt: skip
        self._values = mitsuba.traverse(self._scene)
        self._integrator = _colors(mitsuba, drjit)

    def draw(self, pose: Pose) -> Codes:
        """(h, w, 3) uint8 sRGB."""
        mi = self._mi
        ways = (pose.origin.tolist(), pose.target.tolist(), pose.rotation[:, 1].tolist())
        self._values["sensor.to_world"] = mi.Transform4f().look_at(*ways)
        self._values.update()
        self._number += 1
        image = mi.render(self._scene, integrator=self._integrator, spp=1, seed=self._number)
        return srgb_codes(np.array(image, np.float32)[..., :3])


def _colors(mitsuba: Any, drjit: Any) -> Any:
    """An integrator of Mitsuba: the colour of what a ray hits, or white."""

    class Colors(mitsuba.SamplingIntegrator):  # type: ignore[misc]
        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            hit = scene.ray_intersect(ray, active)
            valid = hit.is_valid()
            color = hit.shape.eval_attribute_3("vertex_color", hit, valid)
            return drjit.select(valid, color, 1.0), valid, []

    return Colors(mitsuba.Properties())


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """How a renderer is had."""

    module: str
    package: str
    start: Callable[[Triangles, tuple[int, int], float], Peer]

    def version(self) -> str:
        """Of the package that is installed."""
        return version(self.package)


PEERS: Mapping[str, Known] = {
    "mitsuba": Known(module="mitsuba", package="mitsuba", start=Mitsuba),
    "open3d": Known(module="open3d", package="open3d", start=Open3D),
    "pyvista": Known(module="pyvista", package="pyvista", start=PyVista),
}


def read_triangles(path: Path) -> Triangles:
    """What `write_triangles` wrote."""
    with np.load(path) as found:
        return Triangles(positions=found["positions"], corners=found["corners"], codes=found["codes"])


def write_triangles(path: Path, triangles: Triangles) -> None:
    """For processes of peers: arrays as they are."""
    np.savez(path, positions=triangles.positions, corners=triangles.corners, codes=triangles.codes)
