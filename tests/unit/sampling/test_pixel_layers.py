"""Layers beside the colour: against plain NumPy, and matrices that turn normals against what defines them."""

from __future__ import annotations

import numpy as np
import pytest

from wall.core.data import SAMPLE, Rect
from wall.core.errors import ConfigError
from wall.core.kernels.albedo import pack_albedo
from wall.sampling.pixel_layers import LAYERS, PixelLayers, checked_layers, normal_matrices, unstacked
from wall.sampling.pixel_means import PixelMeans

RECT = Rect(x=8, y=4, width=2, height=1)
TURNED = np.array([[[0.0, 0, 2, 5], [0, 3, 0, 6], [-1, 0, 0, 7], [0, 0, 0, 1]]])  # scaled by 1, 3, 2, then about +y


def test_each_pixel_has_what_its_samples_say() -> None:
    """Three samples in the left pixel, of which the second is the nearest; one of the sky in the right one."""
    samples = np.zeros(4, SAMPLE)
    samples["xy"] = [(8.5, 4.5), (8.1, 4.2), (8.9, 4.9), (9.5, 4.5)]
    samples["radiance"] = [(1, 2, 3), (2, 2, 5), (6, 2, 4), (7, 7, 7)]
    samples["depth"], samples["object_id"] = (5.0, 3.0, 4.0, np.inf), (1, 1, 1, 0)
    samples["normal"] = [(127, 0), (127, 0), (0, 127), (0, 0)]  # octahedral: +x, +x, +y of the object
    samples["albedo"] = [pack_albedo(*np.float32([1, 0.04, 0.25]))] * 3 + [0xFFFFFF]
    means, layers = PixelMeans(RECT, seed=1), PixelLayers(RECT, LAYERS)
    means.add(samples)
    layers.add(samples)
    layers.add_surfaces(samples, normal_matrices(TURNED))
    found = unstacked(layers.stacked(means), LAYERS)

    assert {name: array.dtype.name for name, array in found.items() if array.dtype != np.float32} == {
        "object_id": "uint32"
    }
    np.testing.assert_allclose(found["colour"], [[(3, 2, 4), (7, 7, 7)]])
    assert found["depth"].tolist() == [[3.0, np.inf]]
    assert found["object_id"].tolist() == [[1, 0]]
    variance = samples["radiance"][:3].astype(float).var(axis=0, ddof=1).mean() / 3
    np.testing.assert_allclose(found["variance"], [[variance, np.inf]], rtol=1e-6)
    np.testing.assert_allclose(found["albedo"], [[(1, 0.04, 0.25), (0, 0, 0)]], atol=2e-3)  # half a code of 255
    np.testing.assert_allclose(found["normal"], [[np.array([0, 1, -2]) / np.sqrt(5), (0, 0, 0)]], atol=1e-6)


def test_normals_stay_at_right_angles_to_surfaces_that_are_scaled_turned_or_mirrored() -> None:
    rng = np.random.default_rng(3)
    poses = np.tile(np.eye(4), (50, 1, 1))
    poses[:, :3, :3] = rng.normal(size=(50, 3, 3))  # half of them mirror
    matrices = normal_matrices(poses).reshape(-1, 3, 3)
    normal, outwards = np.array([0.0, 0, 1]), np.array([0.3, -0.2, 1.0])
    for pose, matrix in zip(poses[:, :3, :3], matrices, strict=True):
        turned = matrix @ normal
        np.testing.assert_allclose(turned @ pose[:, :2], 0.0, atol=1e-5)
        assert turned @ (pose @ outwards) > 0.0
    flat = np.diag([1.0, 1.0, 0.0, 1.0])[None]  # has no inverse
    np.testing.assert_allclose(normal_matrices(flat).reshape(3, 3) @ normal, normal)


def test_what_is_no_layer_is_refused() -> None:
    assert checked_layers(["depth", "albedo", "depth"], where="--layers") == ("depth", "albedo")
    with pytest.raises(ConfigError, match="--layers: 'Z' is no layer; accepted: albedo, normal, depth, variance"):
        checked_layers(["Z"], where="--layers")
