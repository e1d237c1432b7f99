"""Labels that share their walls."""

from __future__ import annotations

import numpy as np
import pytest
import willmore

QUICK = {"cells": 32, "steps": 2}


@pytest.fixture(scope="module")
def halves() -> np.ndarray:
    x, y, z = np.mgrid[:20, :20, :20] - 9.5
    return (x**2 + y**2 + z**2 < 64) * np.where(x < 0, 3, 7)


@pytest.fixture(scope="module")
def walls(halves) -> willmore.SharedSurfaces:
    return willmore.shared_surfaces(halves, spacing=2.0, **QUICK)


def test_walls(halves, walls):
    assert {tuple(pair) for pair in walls.sides.tolist()} == {(3, 0), (7, 0), (3, 7)}
    for told, label in zip(walls.report["labels"], (3, 7)):
        voxels = 8 * np.count_nonzero(halves == label)
        assert told["label"] == label and abs(told["volume_before"] / voxels - 1) < 1e-9
        assert abs(told["volume_after"] / voxels - 1) < 5e-4
        mesh = walls.surface(label)
        edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
        once = {tuple(edge) for edge in edges.tolist()}
        assert len(once) == len(edges) and {edge[::-1] for edge in once} == once
    first, second = ({tuple(x) for x in walls.surface(label).vertices.tolist()} for label in (3, 7))
    wall = np.unique(walls.faces[(walls.sides == [3, 7]).all(axis=1)])
    assert len(first & second) == len(wall)
    assert walls.labels.shape == halves.shape and np.mean(walls.labels == halves) > 0.97
    with pytest.raises(willmore.Error, match=r"no label 4: the labels are \[3, 7\]"):
        walls.surface(4)


def test_files(walls, tmp_path):
    nibabel = pytest.importorskip("nibabel")
    walls.save(tmp_path / "walls.ply")
    assert b"property int label_behind" in (tmp_path / "walls.ply").read_bytes()[:600]
    walls.save(tmp_path / "smooth.nii.gz")
    smooth = nibabel.load(tmp_path / "smooth.nii.gz")
    assert np.array_equal(np.asarray(smooth.dataobj), walls.labels)
    assert np.allclose(smooth.affine, np.diag([2, 2, 2, 1]))
    again = willmore.shared_surfaces(tmp_path / "smooth.nii.gz", **QUICK)
    assert [one["label"] for one in again.report["labels"]] == [3, 7]
    with pytest.raises(willmore.Error, match="vtk"):
        walls.save(tmp_path / "walls.vtk")


def test_pyvista(walls):
    pytest.importorskip("pyvista")
    assert np.array_equal(walls.to_pyvista().cell_data["BoundaryLabels"], walls.sides)


def test_refusals(halves):
    with pytest.raises(willmore.Error, match="`volume` has no meaning"):
        willmore.shared_surfaces(halves, volume="90%")
    with pytest.raises(willmore.Error, match="no labels"):
        willmore.shared_surfaces(np.zeros((4, 4, 4), np.uint8))
