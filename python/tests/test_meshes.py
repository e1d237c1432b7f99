"""Fairing and repair of meshes of all kinds."""

import copy
import warnings

import meshio
import numpy as np
import pytest
import pyvista
import trimesh
import willmore
from conftest import roughness, volume

OPTIONS = {"noise": 0.02, "cells": 24}


@pytest.fixture(scope="module")
def faired(noisy):
    return willmore.fair(noisy, **OPTIONS)


def torus_of_quads(around=32, across=16):
    """A torus of radii 1 and 0.45 of quadrilaterals, with noise."""
    u, v = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.arange(across) * 2 * np.pi / across, indexing="ij")
    radius = 0.45 + np.random.default_rng(2).normal(0, 0.015, u.shape)
    ring = 1 + radius * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), radius * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    corner = lambda a, b: ((i + a) % around * across + (j + b) % across).ravel()
    return points, np.stack([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)], axis=1)


def noise_of_torus(points):
    """The standard deviation of the distances from the middle circle."""
    return np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2]).std()


def test_noise_falls_and_volume_and_faces_stay(noisy, faired):
    mesh = faired.mesh
    assert isinstance(mesh, willmore.Arrays)
    assert roughness(mesh.vertices) < 0.4 * roughness(noisy[0])
    assert volume(*mesh) == pytest.approx(volume(*noisy), rel=1e-6)
    assert np.array_equal(mesh.faces, noisy[1])
    assert mesh.vertices is not noisy[0] and not np.array_equal(mesh.vertices, noisy[0])
    assert faired.ended and faired.report["energy"] < faired.report["first_energy"]
    assert faired.report["mesh"]["noise"] == pytest.approx(0.02)
    moved = np.linalg.norm(mesh.vertices - noisy[0], axis=1)
    assert faired.report["mesh"]["displacement_largest"] == pytest.approx(moved.max(), rel=0.2)


def test_noise_is_estimated(noisy):
    result = willmore.fair(noisy, cells=24)
    assert result.report["mesh"]["noise"] == pytest.approx(0.02, rel=0.3)
    assert any("estimated" in note for note in result.notes)
    assert roughness(result.mesh.vertices) < 0.5 * roughness(noisy[0])


def strided(array):
    """The same values with gaps in memory."""
    wide = np.zeros((2 * len(array), array.shape[1] + 1), dtype=array.dtype)
    wide[::2, 1:] = array
    return wide[::2, 1:]


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


@pytest.mark.parametrize(
    "layout, of_vertices, of_faces",
    [
        (np.asfortranarray, np.float32, np.int32),
        (strided, np.float64, np.uint32),
        (read_only, ">f8", np.uint64),
        (np.ndarray.tolist, np.float64, np.int64),
    ],
)
def test_arrays_of_all_kinds(noisy, faired, layout, of_vertices, of_faces):
    vertices, faces = layout(noisy[0].astype(of_vertices)), layout(noisy[1].astype(of_faces))
    before = copy.deepcopy((vertices, faces))
    mesh = willmore.fair((vertices, faces), **OPTIONS).mesh
    assert mesh.vertices.dtype == of_vertices and mesh.faces.dtype == of_faces
    assert np.array_equal(mesh.faces, noisy[1])
    tolerance = 2e-6 if of_vertices == np.float32 else 0
    assert np.abs(mesh.vertices - faired.mesh.vertices).max() <= tolerance
    assert volume(mesh.vertices, noisy[1]) == pytest.approx(volume(vertices, noisy[1]), rel=1e-6)
    assert np.array_equal(vertices, before[0]) and np.array_equal(faces, before[1])
    assert mesh.vertices.flags.writeable


def test_trimesh(noisy, faired):
    mesh = trimesh.Trimesh(*noisy, process=False, metadata={"name": "scan"})
    mesh.visual.vertex_colors = np.arange(4 * len(noisy[0])).reshape(-1, 4) % 251
    colours, volume_before = mesh.visual.vertex_colors.copy(), mesh.volume
    smooth = willmore.fair(mesh, **OPTIONS).mesh
    assert type(smooth) is trimesh.Trimesh and smooth is not mesh
    assert np.array_equal(mesh.vertices, noisy[0]) and np.array_equal(smooth.faces, noisy[1])
    assert np.array_equal(smooth.vertices, faired.mesh.vertices)
    assert smooth.metadata["name"] == "scan" and np.array_equal(smooth.visual.vertex_colors, colours)
    # Nothing that trimesh has stored of the old shape is left.
    assert smooth.volume == pytest.approx(volume_before, rel=1e-6) and smooth.area < mesh.area


def test_a_mesh_far_away_stays_there(noisy, faired):
    far = np.array([1e6, -2e6, 3e6])
    mesh = trimesh.Trimesh(noisy[0] + far, noisy[1], process=False)
    smooth = willmore.fair(mesh, **OPTIONS).mesh
    assert np.abs(smooth.vertices - far - faired.mesh.vertices).max() < 1e-6
    assert roughness(smooth.vertices - far) < 0.4 * roughness(noisy[0])


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_pyvista(noisy, faired, kind):
    mesh = pyvista.PolyData.from_regular_faces(noisy[0].astype(kind), noisy[1])
    mesh.point_data["value"] = np.arange(mesh.n_points)
    mesh.cell_data["label"] = np.arange(mesh.n_cells)
    before = mesh.copy()
    smooth = willmore.fair(mesh, **OPTIONS).mesh
    assert type(smooth) is pyvista.PolyData and smooth is not mesh and mesh == before
    assert smooth.points.dtype == kind
    assert np.abs(smooth.points - faired.mesh.vertices).max() < 2e-6
    assert np.array_equal(smooth.faces, mesh.faces)
    assert np.array_equal(smooth["value"], mesh["value"]) and np.array_equal(smooth["label"], mesh["label"])


def test_pyvista_with_quads():
    points, quads = torus_of_quads()
    mesh = pyvista.PolyData.from_regular_faces(points, quads)
    mesh["value"] = np.arange(mesh.n_points)
    smooth = willmore.fair(mesh, noise=0.015, cells=32).mesh
    assert np.array_equal(smooth.faces, mesh.faces) and np.array_equal(smooth["value"], mesh["value"])
    assert np.array_equal(mesh.points, points)
    assert noise_of_torus(smooth.points) < 0.6 * noise_of_torus(points)
    triangles = mesh.triangulate().regular_faces
    assert volume(smooth.points, triangles) == pytest.approx(volume(points, triangles), rel=1e-6)


def test_meshio_with_triangles_and_quads():
    points, quads = torus_of_quads()
    half = len(quads) // 2
    triangles = np.concatenate([quads[:half, [0, 1, 2]], quads[:half, [0, 2, 3]]])
    mesh = meshio.Mesh(points.copy(), [("triangle", triangles), ("quad", quads[half:])], point_data={"value": np.arange(len(points))})
    smooth = willmore.fair(mesh, noise=0.015, cells=32).mesh
    assert type(smooth) is meshio.Mesh and smooth is not mesh
    assert [(block.type, block.data.tolist()) for block in smooth.cells] == [(block.type, block.data.tolist()) for block in mesh.cells]
    assert np.array_equal(smooth.point_data["value"], mesh.point_data["value"]) and np.array_equal(mesh.points, points)
    assert noise_of_torus(smooth.points) < 0.6 * noise_of_torus(points)


def test_fixed_vertices_stay_bit_for_bit(noisy):
    fixed = noisy[0][:, 2] > 0.3
    mesh = willmore.fair(noisy, fixed=fixed, **OPTIONS).mesh
    assert np.array_equal(mesh.vertices[fixed], noisy[0][fixed])
    # Those beside the part that stays still move, and far away the noise is off.
    assert (mesh.vertices[~fixed] != noisy[0][~fixed]).any(axis=1).mean() > 0.9
    far = noisy[0][:, 2] < -0.3
    assert roughness(mesh.vertices[far]) < 0.5 * roughness(noisy[0][far])
    assert volume(*mesh) == pytest.approx(volume(*noisy), rel=1e-6)


def test_fixed_region(noisy):
    mesh = willmore.fair(noisy, fixed="box:-2,-2,0.3,2,2,2", **OPTIONS).mesh
    inside = noisy[0][:, 2] >= 0.3
    assert np.array_equal(mesh.vertices[inside], noisy[0][inside])


def test_remesh(noisy):
    vertices = noisy[0].astype(np.float32)
    result = willmore.fair((vertices, noisy[1].astype(np.int32)), remesh=np.True_, **OPTIONS)
    mesh = result.mesh
    assert mesh.vertices.dtype == np.float32 and mesh.faces.dtype == np.int32
    assert mesh.vertices.shape != vertices.shape
    assert volume(*mesh) == pytest.approx(volume(*noisy), rel=0.02)
    assert roughness(mesh.vertices) < 0.5 * roughness(noisy[0])
    assert len(result.to_trimesh().faces) == result.to_pyvista().n_cells == len(mesh.faces)


def test_a_new_mesh_has_faces_of_a_type_that_holds_them(noisy):
    mesh = willmore.fair((noisy[0], noisy[1].astype(np.uint8)), remesh=True, **OPTIONS).mesh
    assert len(mesh.vertices) > 256 and mesh.faces.max() == len(mesh.vertices) - 1
    assert volume(*mesh) == pytest.approx(volume(*noisy), rel=0.02)


def test_energy_ratio_keeps_the_volume_unless_told_otherwise(noisy):
    kept = willmore.fair(noisy, energy_ratio=0.99, cells=24)
    assert volume(*kept.mesh) == pytest.approx(volume(*noisy), rel=1e-6)
    assert kept.report["energy"] <= 0.99 * kept.report["first_energy"]


def test_files_are_written(faired, tmp_path):
    for ending in ("ply", "obj", "stl"):
        faired.save(tmp_path / f"mesh.{ending}")
        read = trimesh.load(tmp_path / f"mesh.{ending}", process=False)
        assert read.volume == pytest.approx(volume(*faired.mesh), rel=1e-5)
    with pytest.raises(willmore.Error):
        faired.save(tmp_path / "mesh.png")
    with pytest.raises(OSError):
        faired.save(tmp_path / "missing" / "mesh.ply")


def test_a_file_is_read_by_its_name(noisy, faired, tmp_path):
    path = tmp_path / "scan.ply"
    lines = [f"{x!r} {y!r} {z!r}" for x, y, z in noisy[0].tolist()] + [f"3 {a} {b} {c}" for a, b, c in noisy[1].tolist()]
    head = f"ply\nformat ascii 1.0\nelement vertex {len(noisy[0])}\nproperty double x\nproperty double y\nproperty double z\n"
    head += f"element face {len(noisy[1])}\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_text(head + "\n".join(lines) + "\n")
    mesh = willmore.fair(path, **OPTIONS).mesh
    assert isinstance(mesh, willmore.Arrays) and np.array_equal(mesh.vertices, faired.mesh.vertices)


@pytest.fixture(scope="module")
def open_mesh():
    box = trimesh.creation.box((1, 0.3, 0.3))
    return np.array(box.vertices), np.array(box.faces)[:-2]


def test_repair(open_mesh):
    mesh = trimesh.Trimesh(*open_mesh, process=False)
    with pytest.warns(willmore.WillmoreWarning, match="closes holes") as told:
        closed = willmore.repair(mesh)
    assert told[0].filename == __file__
    assert type(closed) is trimesh.Trimesh and closed.is_watertight and not mesh.is_watertight
    assert closed.volume == pytest.approx(0.09, rel=0.1)


def test_fair_with_repair(open_mesh):
    with pytest.raises(willmore.Error, match="open"):
        willmore.flow(open_mesh, cells=24, steps=1)
    with pytest.warns(willmore.WillmoreWarning, match="closes holes") as told:
        result = willmore.fair(open_mesh, repair=True, cells=24, steps=1)
    assert told[0].filename == __file__ and result.warnings
    assert trimesh.Trimesh(*result.mesh).is_watertight


def test_the_boundary_of_an_open_mesh_stays(noisy):
    vertices, faces = noisy
    top = vertices[faces].mean(axis=1)[:, 2]
    kept = faces[top < np.quantile(top, 0.9)]
    with pytest.warns(willmore.WillmoreWarning, match="closed by smooth lids"):
        faired = willmore.fair((vertices, kept), **OPTIONS).mesh
    edges = trimesh.Trimesh(vertices, kept, process=False).edges_sorted
    rim = np.unique(edges[trimesh.grouping.group_rows(edges, require_count=1)])
    assert np.array_equal(faired.vertices[rim], vertices[rim])
    assert np.array_equal(faired.faces, kept) and not np.array_equal(faired.vertices, vertices)


def test_warnings_point_at_the_caller(sphere):
    lonely = np.concatenate([sphere[0], sphere[0][:1]]), sphere[1]
    for act in (
        lambda: willmore.fair(lonely, cells=24, steps=1),
        lambda: willmore.flow(lonely, cells=24, steps=1),
        lambda: willmore.energy(lonely, cells=24),
    ):
        with pytest.warns(willmore.WillmoreWarning, match="1 vertices of no face") as told:
            result = act()
        assert [warning.filename for warning in told] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(willmore.WillmoreWarning):
            willmore.flow(lonely, cells=24, steps=1)
    assert result > 0


def test_a_vertex_of_no_face_stays_in_the_mesh(sphere):
    lonely = np.concatenate([sphere[0], [[3.0, 0, 0]]]), sphere[1]
    with pytest.warns(willmore.WillmoreWarning):
        mesh = willmore.fair(lonely, cells=24, steps=1).mesh
    assert mesh.vertices.shape == lonely[0].shape and np.array_equal(mesh.faces, sphere[1])


def with_value(array, value):
    array = array.copy()
    array[3, 1] = value
    return array


REFUSED = {
    "empty": lambda v, f: (v[:0], f[:0]),
    "no faces": lambda v, f: (v, f[:0]),
    "empty trimesh": lambda v, f: trimesh.Trimesh(),
    "empty pyvista": lambda v, f: pyvista.PolyData(),
    "empty meshio": lambda v, f: meshio.Mesh(v, []),
    "lines of meshio": lambda v, f: meshio.Mesh(v, [("line", f[:, :2])]),
    "cells of pyvista": lambda v, f: pyvista.PolyData.from_regular_faces(v, f).cast_to_unstructured_grid(),
    "index too large": lambda v, f: (v, f + 5),
    "negative index": lambda v, f: (v, f - 1),
    "NaN": lambda v, f: (with_value(v, np.nan), f),
    "infinite": lambda v, f: (with_value(v, np.inf), f),
    "two coordinates": lambda v, f: (v[:, :2], f),
    "four vertices each": lambda v, f: (v, np.c_[f, f[:, 0]]),
    "flat": lambda v, f: (v.ravel(), f),
    "faces of float": lambda v, f: (v, f.astype(float)),
    "faces of bool": lambda v, f: (v, f > 0),
    "complex": lambda v, f: (v + 0j, f),
    "text": lambda v, f: (["a", "b"], f),
    "ragged vertices": lambda v, f: ([[1, 2, 3], [4]], f),
    "ragged faces": lambda v, f: (v, [[0, 1, 2], [3]]),
    "four arrays": lambda v, f: (v, f, v, v[:, 0]),
    "nothing": lambda v, f: None,
    "a number": lambda v, f: 3,
    "collapsed": lambda v, f: (0 * v, f),
    "too far away": lambda v, f: (v + 1e16, f),
    "no such file": lambda v, f: "missing.ply",
    "no such shape": lambda v, f: "builtin:teapot",
}


@pytest.mark.parametrize("make", REFUSED.values(), ids=REFUSED.keys())
def test_refused_meshes(sphere, make):
    with pytest.raises(willmore.Error) as refused:
        willmore.fair(make(*sphere), steps=1, cells=24)
    assert isinstance(refused.value, ValueError)
    assert str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "options, says",
    [
        ({"celsl": 4}, "`celsl`.*`cells`"),
        ({"help": True}, "`help`"),
        ({"cells": 0}, "`cells`"),
        ({"cells": 24.5}, "`cells`"),
        ({"cells": -5}, "`cells`"),
        ({"steps": 0}, "`steps`"),
        ({"tau": -1}, "`tau`"),
        ({"tau": [1, 2]}, "`tau`"),
        ({"volume": "much"}, "`volume`"),
        ({"noise": float("nan")}, "`noise`"),
        ({"output": "folder"}, "`output`.*Run.start"),
        ({"save": "mesh.ply"}, "`save`.*Run.start"),
        ({"fixed": np.ones(5, bool)}, "162 vertices"),
        ({"fixed": np.ones(162)}, "`fixed`"),
        ({"fixed": np.ones(162, bool)}, "`fixed`"),
        ({"fixed": "bix:1"}, "bix:1"),
    ],
)
def test_refused_options(sphere, options, says):
    with pytest.raises(willmore.Error, match=says) as refused:
        willmore.fair(sphere, **{"cells": 24, "steps": 1, **options})
    assert "\n" not in str(refused.value) and "--" not in str(refused.value)


def test_an_array_cannot_fix_vertices_of_a_file():
    with pytest.raises(willmore.Error, match="`fixed`"):
        willmore.fair("builtin:cube", fixed=np.ones(8, bool), steps=1, cells=24)


def test_signed_distance(sphere):
    points = np.array([[[0.0, 0, 0], [0, 0, 3]], [[0, 0.5, 0], [2, 0, 0]]])
    distances = willmore.signed_distance(sphere, points)
    assert distances.shape == (2, 2)
    assert distances == pytest.approx(np.linalg.norm(points, axis=-1) - 1, abs=0.03)
    assert willmore.signed_distance(trimesh.Trimesh(*sphere), [0, 0, 0]).shape == ()
    assert willmore.signed_distance(sphere, np.zeros((0, 3))).shape == (0,)
    for mesh, where in ((sphere, [0, 0]), ((sphere[0], sphere[1][1:]), [0, 0, 0]), ("builtin:cube", [0, 0, 0]), (sphere, "here")):
        with pytest.raises(willmore.Error):
            willmore.signed_distance(mesh, where)


def test_files_have_no_marks_of_fixed_vertices(tmp_path):
    mesh = trimesh.creation.icosphere(2)
    fixed = mesh.vertices[:, 2] < 0
    result = willmore.fair(mesh, fixed=fixed, steps=1, cells=24)
    result.save(tmp_path / "fixed.ply")
    assert b"red" not in (tmp_path / "fixed.ply").read_bytes()[:400]
    assert result.to_trimesh() is result.mesh
    with pytest.raises(willmore.Error, match="indices"):
        willmore.fair(mesh, fixed=np.flatnonzero(fixed), steps=1, cells=24)
