"""Surfaces of segmentations."""

import nibabel
import numpy as np
import pytest
import pyvista
import trimesh
import willmore
from conftest import centroid, volume
from skimage.measure import marching_cubes

QUICK = {"cells": 24, "steps": 1}


@pytest.fixture(scope="module")
def of_mask(ball):
    return willmore.surfaces(ball, **QUICK)[1]


def test_volume_and_place_of_a_mask(ball, of_mask):
    # The volume of the voxels is held exactly on the grid, and about so by the triangles of a coarse one.
    assert of_mask.report["volume"] == pytest.approx(ball.sum(), rel=1e-9)
    assert volume(*of_mask.mesh) == pytest.approx(ball.sum(), rel=0.02)
    assert centroid(*of_mask.mesh) == pytest.approx(np.argwhere(ball).mean(axis=0), abs=0.1)
    assert trimesh.Trimesh(*of_mask.mesh).is_watertight


@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.uint16, ">i2", np.int32, np.int64, np.uint64, np.float16, ">f4", np.float64])
def test_labels_of_all_types(ball, of_mask, kind):
    # Each type has its own way into the library; the first step says whether the values have arrived.
    surfaces = willmore.surfaces(np.asfortranarray(ball.astype(kind) * 5), **QUICK)
    assert list(surfaces) == [5]
    assert np.array_equal(surfaces[5].mesh.vertices, of_mask.mesh.vertices)


def test_a_smooth_surface_of_a_ball(ball):
    result = willmore.surfaces(ball, cells=32)[1]
    distances = np.linalg.norm(result.mesh.vertices - [5.2, 6.1, 6.7], axis=1)
    # The staircase of the voxels has steps of 1.
    assert distances.std() < 0.1 and distances.mean() == pytest.approx(14.5**0.5, abs=0.1)
    assert result.report["euler_characteristic"] == 2


def test_spacing_and_origin(ball, of_mask):
    result = willmore.surfaces(ball, spacing=(2, 2, 2), origin=[10, -20, 30], **QUICK)[1]
    assert np.allclose(result.mesh.vertices, 2 * of_mask.mesh.vertices + [10, -20, 30], atol=1e-9)
    result = willmore.surfaces(ball, spacing=(1, 1.5, 2), **QUICK)[1]
    assert result.report["volume"] == pytest.approx(3 * ball.sum(), rel=1e-9)
    assert centroid(*result.mesh) == pytest.approx(np.argwhere(ball).mean(axis=0) * [1, 1.5, 2], abs=0.2)


@pytest.mark.parametrize("mirror", [1, -1])
def test_nibabel_with_a_sheared_affine(ball, mirror):
    affine = np.array([[2 * mirror, 0.5, 0, 10], [0, 1.5, 0.25, -20], [0.25, 0, 1, 5], [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(ball.astype(np.int16), affine)
    result = willmore.surfaces(image, cells=32)[1]
    assert result.report["volume"] == pytest.approx(ball.sum() * abs(np.linalg.det(affine)), rel=1e-9)
    assert volume(*result.mesh) == pytest.approx(ball.sum() * abs(np.linalg.det(affine)), rel=0.02)
    middle = affine[:3, :3] @ np.argwhere(ball).mean(axis=0) + affine[:3, 3]
    assert centroid(*result.mesh) == pytest.approx(middle, abs=0.1)


def test_affine_of_an_array(ball, of_mask):
    result = willmore.surfaces(ball, affine=np.array([[2, 0, 0, 1], [0, 2, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]), **QUICK)[1]
    assert np.allclose(result.mesh.vertices, 2 * of_mask.mesh.vertices + [1, 2, 3], atol=1e-9)


@pytest.mark.parametrize("cells", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_pyvista(ball, cells, turned):
    grid = pyvista.ImageData(dimensions=np.array(ball.shape) + cells, spacing=(1, 2, 1.5), origin=(4, 5, 6))
    if turned:
        grid.offset = (3, 4, 5)
        grid.direction_matrix = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
    data = grid.cell_data if cells else grid.point_data
    data["label"] = ball.astype(np.uint8).ravel(order="F")
    points = grid.cell_centers().points if cells else grid.points
    result = willmore.surfaces(grid, **QUICK)[1]
    assert result.report["volume"] == pytest.approx(3 * ball.sum(), rel=1e-9)
    assert centroid(*result.mesh) == pytest.approx(points[data["label"] == 1].mean(axis=0), abs=0.1)


def test_threshold_and_place_as_marching_cubes(ball):
    x, y, z = np.mgrid[:12, :13, :14]
    grey = 4 - np.sqrt((x - 5.2) ** 2 + (y - 6.1) ** 2 + (z - 6.7) ** 2)
    result = willmore.surfaces(grey, threshold=0.0, volume=None, **QUICK)
    assert list(result) == [1]
    vertices, faces = marching_cubes(grey, 0.0)[:2]
    faces = faces if volume(vertices, faces) > 0 else faces[:, ::-1]
    assert centroid(*result[1].mesh) == pytest.approx(centroid(vertices, faces), abs=0.02)
    assert np.abs(np.linalg.norm(result[1].mesh.vertices - [5.2, 6.1, 6.7], axis=1) - 4).max() < 0.15
    whole = willmore.surfaces((10 * grey + 100).round().astype(np.uint8), threshold=99.5, volume=None, **QUICK)[1]
    assert np.abs(np.linalg.norm(whole.mesh.vertices - [5.2, 6.1, 6.7], axis=1) - 4).max() < 0.2


def test_several_labels():
    labels = np.zeros((20, 20, 20), dtype=np.int16)
    labels[3:9, 3:9, 3:9], labels[11:18, 11:18, 11:18] = 300, -7
    surfaces = willmore.surfaces(labels, **QUICK)
    assert sorted(surfaces) == [-7, 300]
    for label, result in surfaces.items():
        assert result.report["volume"] == pytest.approx((labels == label).sum(), rel=1e-9)
        assert centroid(*result.mesh) == pytest.approx(np.argwhere(labels == label).mean(axis=0), abs=0.02)
    for label in ({300}, np.array([300])):
        assert list(willmore.surfaces(labels, label=label, **QUICK)) == [300]


@pytest.mark.parametrize(
    "labels, options",
    [
        (np.zeros((5, 5, 5), int), {}),
        (np.zeros((5, 5, 5), bool), {}),
        (np.zeros((0, 5, 5), int), {}),
        (np.ones((5, 5), int), {}),
        (np.ones((5, 5, 5, 2), int), {}),
        (np.full((5, 5, 5), 0.5), {}),
        (np.full((5, 5, 5), np.nan), {}),
        (np.full((5, 5, 5), np.nan), {"threshold": 0.5}),
        (np.ones((5, 5, 5)), {"threshold": 100.0}),
        (np.full((5, 5, 5), 2**40), {}),
        (np.ones((5, 5, 5), complex), {}),
        (np.ones((5, 5, 5), object), {}),
        ("labels.nii", {}),
        ([[1], [2, 3]], {}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"label": 4}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"label": []}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"label": "liver"}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"label": 1.5}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"label": 1, "threshold": 0.5}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"affine": np.eye(4), "spacing": 2}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"affine": np.eye(3)}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"affine": np.zeros((4, 4))}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"affine": np.full((4, 4), np.nan)}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"spacing": (1, 2)}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"spacing": 0}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"origin": "here"}),
        (np.eye(5, dtype=int)[None].repeat(5, axis=0), {"smoothness": 1}),
    ],
)
def test_refused(labels, options):
    with pytest.raises(willmore.Error) as refused:
        willmore.surfaces(labels, **options)
    assert "\n" not in str(refused.value)


def test_refused_grids():
    rectilinear = pyvista.RectilinearGrid(np.arange(4.0), np.arange(4.0), np.arange(4.0))
    image = nibabel.Nifti1Image(np.ones((4, 4, 4), np.uint8), np.eye(4))
    for labels, options in ((pyvista.ImageData(dimensions=(3, 3, 3)), {}), (rectilinear, {}), (image, {"spacing": 2.0})):
        with pytest.raises(willmore.Error):
            willmore.surfaces(labels, **options)
    with pytest.raises(willmore.Error, match="`surfaces`"):
        willmore.flow(image)


def test_the_label_of_the_outside_is_refused():
    with pytest.raises(willmore.Error, match="outside"):
        willmore.surfaces(np.ones((4, 4, 4), np.uint8), label=[1, 0])


def test_a_file_by_its_name(tmp_path):
    labels = np.zeros((16, 16, 16), np.uint8)
    labels[4:12, 4:12, 4:12] = 3
    nibabel.save(nibabel.Nifti1Image(labels, np.diag([2.0, 2.0, 2.0, 1.0])), tmp_path / "labels.nii.gz")
    (of_file,) = willmore.surfaces(tmp_path / "labels.nii.gz", cells=24).items()
    (of_array,) = willmore.surfaces(labels, spacing=2, cells=24).items()
    assert of_file[0] == of_array[0] == 3
    assert np.array_equal(of_file[1].field, of_array[1].field)


def test_labels_are_those_of_the_frame(tmp_path):
    labels = np.zeros((16, 16, 16, 2), np.uint8)
    labels[4:12, 4:12, 4:12, 0], labels[5:11, 5:11, 5:11, 1] = 3, 7
    path = tmp_path / "labels.nii.gz"
    nibabel.save(nibabel.Nifti1Image(labels, np.eye(4)), path)
    assert list(willmore.surfaces(path, frame=0, **QUICK)) == [3]
    (of_file,) = willmore.surfaces(path, frame=1, **QUICK).items()
    assert of_file[0] == 7
    assert np.array_equal(of_file[1].field, willmore.surfaces(labels[..., 1], **QUICK)[7].field)
    with pytest.raises(willmore.Error, match="`frame`"):
        willmore.surfaces(path, **QUICK)
