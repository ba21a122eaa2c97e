"""`wall.render`: the image of `wall render`, its layers, the file that holds them, and the examples."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from typer.testing import CliRunner

import wall
from wall import cli
from wall.core.errors import ConfigError
from wall.display.image_file import CHANNELS
from wall.sampling.pixel_layers import LAYERS
from wall.scripting.background import has_samples

SIZE = (64, 48)
HARMONIC, HEAD = "configs/harmonic.vtk", 119  # bytes before its points
EXAMPLES = Path(__file__).parents[3] / "docs/examples"
SCENE = wall.Scene("courtyard")


@pytest.fixture(scope="module")
def layers() -> dict[str, Any]:
    return wall.render(SCENE, size=SIZE, samples=2, seed=3, layers=LAYERS)


def object_id(name: str) -> int:
    built = SCENE.planned(SCENE.loaded)[0].scene
    return next(k for k, instance in enumerate(built.instances, 1) if instance.name == name)


@pytest.mark.usefixtures("compiled_only")
class TestLayers:
    def test_they_change_nothing_of_the_image(self, layers: dict[str, Any]) -> None:
        image = wall.render(SCENE, size=SIZE, samples=2, seed=3)
        assert image.dtype == np.float32
        np.testing.assert_array_equal(layers["colour"], image)
        assert list(layers) == ["colour", *LAYERS]

    def test_the_floor_faces_up_the_sky_is_far_and_mirrors_have_shape(self, layers: dict[str, Any]) -> None:
        """Edges of the floor share their pixels with others; most pixels do not. The knot mirrors, and turns."""
        of, normal = layers["object_id"], layers["normal"]
        floor, sky, knot = of == object_id("floor"), of == 0, of == object_id("knot")
        assert min(floor.sum(), sky.sum(), knot.sum()) > 20
        np.testing.assert_allclose(np.median(normal[floor], axis=0), (0, 1, 0), atol=0.01)
        assert not normal[sky].any()
        assert not layers["albedo"][sky].any()
        assert np.isinf(layers["depth"][sky]).all()
        np.testing.assert_allclose(np.linalg.norm(normal[~sky], axis=-1), 1.0, atol=1e-5)
        assert normal[knot].std(axis=0).min() > 0.2
        assert 5 < layers["depth"][knot].min() < layers["depth"][knot].max() < 20
        assert 0.04 < layers["albedo"][~sky].mean() < 0.9
        assert np.isfinite(layers["variance"]).all()

    def test_an_exr_has_them_by_the_names_that_others_read(self, layers: dict[str, Any], tmp_path: Path) -> None:
        path = tmp_path / "x.exr"
        options = ["--spp", "2", "--seed", "3", "--size", "64x48", "--layers", "all", "-o", str(path)]
        done = CliRunner().invoke(cli.app, ["render", "courtyard", *options])
        assert done.exit_code == 0, done.output
        with OpenEXR.File(str(path), separate_channels=True) as file:
            read = {name: channel.pixels for name, channel in file.channels().items()}
        assert read.keys() == {
            "R", "G", "B", "albedo.R", "albedo.G", "albedo.B", "N.X", "N.Y", "N.Z", "Z", "variance", "id",
        }  # fmt: skip
        for layer, names in CHANNELS.items():
            expected = layers[layer].reshape(48, 64, -1)
            for k, name in enumerate(names):
                assert read[name].dtype == expected.dtype
                np.testing.assert_array_equal(read[name], expected[:, :, k])

    def test_a_camera_a_size_and_an_integrator_are_those_of_a_configuration(self, tmp_path: Path) -> None:
        path = tmp_path / "wall.yaml"
        path.write_text(
            "version: 1\nscene: {source: courtyard, integrator: {method: ambient_occlusion, distance: 3}}\n"
            "wall: {grid: {columns: 2, rows: 2, pixels: [480, 270], size: [0.48, 0.27], bezel: 0.006}}\n"
            "views: [{camera: {position: [6, 4, 10], target: [0, 1, 0], fov: 50}}]\n"
        )
        camera = {"position": np.array([6, 4, 10]), "target": (0, 1, 0), "fov": 50}
        integrator = {"method": "ambient_occlusion", "distance": 3}
        found = wall.render(SCENE, camera=camera, size=(32, 24), samples=2, integrator=integrator)
        np.testing.assert_array_equal(found, wall.render(path, size=(32, 24), samples=2))

    @pytest.mark.parametrize("name", ["render", "layers", "scene"])
    def test_examples_run(self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [f"{name}.py", "48x32"])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        assert [path.suffix for path in tmp_path.iterdir()] == [".png"]

    def test_the_surface_of_a_configuration_is_what_its_example_writes(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(sys, "argv", ["harmonic.py", str(tmp_path / "made.vtk")])
        runpy.run_path(str(EXAMPLES / "harmonic.py"), run_name="__main__")
        made, shipped = (file.read_bytes() for file in (tmp_path / "made.vtk", EXAMPLES.parents[1] / HARMONIC))
        assert made[:HEAD] == shipped[:HEAD]
        assert len(made) == len(shipped)
        points, there = (np.frombuffer(file, ">f4", 3 * 97 * 49, HEAD) for file in (made, shipped))
        np.testing.assert_allclose(points, there, atol=1e-6)  # sines of other processors


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"layers": ["Z"]}, "layers: 'Z' is no layer"),
        ({"layers": "depth"}, "layers = 'depth': is not a list"),
        ({"size": (0, 5)}, "size = (0, 5): is no size"),
        ({"size": 480}, "size = 480: is no size"),
        ({"samples": 0}, "samples = 0: accepted: a whole number from 1 to 65536"),
        ({"seed": -1}, "seed = -1: accepted"),
        ({"at": -1.0}, "at = -1.0: accepted"),
        ({"at": "2.5"}, "at = '2.5': accepted: seconds"),
        ({"camera": {"position": (1, 2, 3)}}, "views[0].camera: has only one of position and target"),
        ({"integrator": "pathe"}, "views[0].integrator.method = 'pathe': is not known"),
        ({"view": "none"}, "none: courtyard has no such view; accepted: main"),
    ],
)
def test_what_cannot_be_rendered_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        wall.render(SCENE, **options)
    assert said in str(refused.value)


def test_numbers_may_be_those_of_numpy() -> None:
    sizes = np.array([32, 18])
    image = wall.render(SCENE, size=(sizes[0], sizes[1]), samples=np.int32(1), seed=np.uint32(3), at=np.float32(0.5))
    np.testing.assert_array_equal(image, wall.render(SCENE, size=(32, 18), samples=1, seed=3, at=0.5))


def test_only_an_exr_holds_layers(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli.app, ["render", "courtyard", "--layers", "depth", "-o", str(tmp_path / "x.png")])
    assert isinstance(done.exception, ConfigError)
    assert "accepted: .exr" in str(done.exception)


def test_a_first_image_has_samples_of_every_renderer() -> None:
    """Of 40 and of 2 x 20 pixels: a quarter of them, each."""
    regions = ["r0c0 8x5+0+0", "r0c1 5x4+0+0; r0c2 5x4+0+0"]
    ranks = [{"rank": 0, "role": "compositor", "region": ""}]
    ranks += [{"rank": k + 1, "role": "renderer", "region": region} for k, region in enumerate(regions)]

    def seen(*samples: int) -> bool:
        return has_samples({"ranks": ranks, "totals": [{"samples": count} for count in (0, *samples)]})

    assert seen(10, 10)
    assert not seen(10, 9)
    assert not seen(0, 100)
