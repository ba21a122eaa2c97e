"""The same image by Mitsuba 3: one mesh, one directional light, direct light, one sample a pixel, one core.

Runs in its own process (python -m wall.study.speed.mitsuba_peer), because Mitsuba fixes its threads and its libLLVM
when it is loaded. Both renderers get one core; compilation is done before the clock starts.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from wall.commands.render import render
from wall.core.data import SAMPLE, Float32
from wall.core.errors import RunError
from wall.roles.plan import Plan, first_event
from wall.sampling.ownership import block_order
from wall.scene.build import Scene, assemble
from wall.scene.model import DirectionalLight, Instance, Material, Mesh, Sky, Source
from wall.study.mitsuba.description import sensor
from wall.study.mitsuba.library import OLDEST_LLVM, libllvm
from wall.study.speed.record import Row, compared, skipped
from wall.study.speed.tracing import plan_of
from wall.tracing.kernels import trace as kernels
from wall.tracing.tracer import Tracer
from wall.tracing.tracer_scene import make_tracer_scene

PEER_LIMIT_S = 240.0
COMPARE_SPP = 64
BLACK = (0.0, 0.0, 0.0)
TOWARDS_LIGHT = (0.48, 0.64, 0.6)
IRRADIANCE, ALBEDO = 3.0, 0.8


def measure(rounds: int) -> list[Row]:
    """mitsuba_llvm: samples a second a core, ours against theirs, and how far the two images are apart."""
    found = in_own_process("wall.study.speed.mitsuba_peer", rounds)
    if isinstance(found, str):
        return [skipped("mitsuba_llvm", "M samples/s", "ratio >= 1", found)]
    note = f"{found['triangles']} triangles, one directional light, {found['pixels']} pixels at 1 sample, one core each"
    return [
        compared(
            "mitsuba_llvm", found["ours"], found["theirs"], unit="M samples/s", at_least=1.0, note=note,
            rmse=found["rmse"], mean_radiance=found["mean"], mitsuba=found["version"],
        )
    ]  # fmt: skip


def in_own_process(module: str, rounds: int) -> dict[str, Any] | str:
    """What a module's process writes to rates.json, or why it was not started. Raises RunError where it fails."""
    if find_spec("mitsuba") is None:
        return "Mitsuba is not installed (pip install 'wall[measure]')"
    library = libllvm()
    if library is None:
        return f"no libLLVM of version {OLDEST_LLVM} or newer (Debian: apt install libllvm19)"
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", module, folder, str(rounds)]
        environment = os.environ | {"DRJIT_LIBLLVM_PATH": library}
        done = subprocess.run(command, capture_output=True, text=True, timeout=PEER_LIMIT_S, env=environment)
        if done.returncode:
            raise RunError(f"Mitsuba, with {library}: {done.stderr.strip()[-300:]}")
        found: dict[str, Any] = json.loads((Path(folder) / "rates.json").read_text(encoding="utf-8"))
    return found


def _main(folder: str, rounds: int) -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    plan = _one_mesh(plan_of("courtyard"))
    ours, theirs = Ours(plan), Theirs(plan, Path(folder))
    ours.rate(), theirs.rate()
    turns = [(ours.rate() / 1e6, theirs.rate() / 1e6) for _ in range(rounds)]
    reference, peer = ours.image(), theirs.image()
    result = {
        "ours": [turn[0] for turn in turns],
        "theirs": [turn[1] for turn in turns],
        "rmse": float(np.sqrt(np.mean((reference - peer) ** 2))),
        "mean": float(reference.mean()),
        "triangles": plan.scene.triangles,
        "pixels": reference.shape[0] * reference.shape[1],
        "version": theirs.version,
    }
    Path(folder, "rates.json").write_text(json.dumps(result), encoding="utf-8")


def _one_mesh(plan: Plan) -> Plan:
    """The courtyard at rest as one white mesh without shading normals, under one directional light and a black sky."""
    vertices, triangles, start = [], [], 0
    for instance in plan.scene.instances:
        mesh = plan.scene.meshes[instance.mesh]
        placed = mesh.vertices @ instance.world_from_object[:3, :3].T + instance.world_from_object[:3, 3]
        vertices.append(placed)
        triangles.append(mesh.triangles + start)
        start += len(placed)
    merged = Mesh(
        name="all", vertices=np.concatenate(vertices).astype(np.float32),
        triangles=np.concatenate(triangles).astype(np.uint32), material=0,
    )  # fmt: skip
    scene: Scene = assemble(
        Source(
            meshes=(merged,),
            materials=(Material(name="white", base_color=(ALBEDO,) * 3),),
            textures=(),
            instances=(Instance(name="all", mesh=0, world_from_object=np.eye(4)),),
            lights=(DirectionalLight(direction=TOWARDS_LIGHT, irradiance=(IRRADIANCE,) * 3),),
            sky=Sky(zenith=BLACK, horizon=BLACK, ground=BLACK),
        )
    )
    return replace(plan, scene=scene)


class Ours:
    """The tracer of `wall`, on one scene."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        layout = plan.layout
        self._tracer = Tracer(make_tracer_scene(plan.scene), layout.wall.panels[0], plan.view.eye, coherent=True)
        self._tracer.set_event(first_event(plan, 0.0))
        self._xy = (block_order(layout.regions[0][0].rect, worker=0, workers=1) + 0.5).astype(np.float32)
        self._samples = np.zeros(len(self._xy), SAMPLE)

    def rate(self) -> float:
        """Traces one batch and returns samples a second."""
        arguments = self._tracer.arguments(self._xy, self._samples)
        began = time.perf_counter()
        kernels.trace(*arguments)
        return len(self._xy) / (time.perf_counter() - began)

    def image(self) -> Float32:
        """Returns the rendered image, (h, w, 3) linear RGB."""
        image = render(self._plan, spp=COMPARE_SPP, seed=1, at=0.0)
        assert image is not None  # there is one rank
        return image


class Theirs:
    """Mitsuba 3 on the LLVM backend, on the same scene."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        import drjit
        import mitsuba

        mitsuba.set_variant("llvm_ad_rgb")
        drjit.set_thread_count(1)
        self._mi, self._dr, self.version = mitsuba, drjit, mitsuba.__version__
        self._size = plan.layout.wall.panels[0].pixels
        self._scene = mitsuba.load_dict(self._description(plan, folder / "all.ply"))

    def _description(self, plan: Plan, file: Path) -> dict[str, Any]:
        mi, mesh = self._mi, plan.scene.meshes[0]
        shape = mi.Mesh("all", len(mesh.vertices), len(mesh.triangles))
        parameters = mi.traverse(shape)
        pose = plan.scene.instances[0].world_from_object
        world = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
        parameters["vertex_positions"] = np.ascontiguousarray(world, np.float32).ravel()
        parameters["faces"] = mesh.triangles.astype(np.uint32).ravel()
        parameters.update()
        shape.write_ply(str(file))
        return {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
            "sensor": sensor(mi, plan, spp=1),
            "sun": {
                "type": "directional", "direction": [-c for c in TOWARDS_LIGHT],
                "irradiance": {"type": "rgb", "value": [IRRADIANCE] * 3},
            },
            "mesh": {
                "type": "ply", "filename": str(file), "face_normals": True,
                "bsdf": {"type": "twosided", "bsdf": {
                    "type": "diffuse", "reflectance": {"type": "rgb", "value": [ALBEDO] * 3}}},
            },
        }  # fmt: skip

    def rate(self) -> float:
        """Renders one sample for each pixel and returns samples a second."""
        width, height = self._size
        began = time.perf_counter()
        self._dr.eval(self._mi.render(self._scene, spp=1, seed=self._mi.UInt32(1)))
        self._dr.sync_thread()
        return width * height / (time.perf_counter() - began)

    def image(self) -> Float32:
        """Returns the rendered image, (h, w, 3) linear RGB."""
        return np.array(self._mi.render(self._scene, spp=COMPARE_SPP, seed=self._mi.UInt32(2)), np.float32)[:, :, :3]


if __name__ == "__main__":
    _main(sys.argv[1], int(sys.argv[2]))
