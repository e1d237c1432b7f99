"""Meshes as people have them: arrays, or the objects of trimesh, pyvista and meshio, which are recognised by their attributes."""

from __future__ import annotations

import copy
import os
from typing import Any, NamedTuple, Protocol

import numpy as np

from ._willmore import Error


class Arrays(NamedTuple):
    """A mesh of triangles as two arrays.

    Attributes
    ----------
    vertices : (n, 3) array of float
        Positions.
    faces : (m, 3) array of int
        Three vertices each, counter-clockwise seen from outside.
    """

    vertices: np.ndarray
    faces: np.ndarray


class Kind(Protocol):
    """A mesh of some library."""

    vertices: np.ndarray
    faces: np.ndarray

    def moved(self, vertices: np.ndarray) -> Any:
        """A copy with its vertices moved."""

    def anew(self, vertices: np.ndarray, faces: np.ndarray) -> Any:
        """Another mesh of this kind."""


def of(mesh: Any) -> Kind | None:
    """The mesh in an object, or None if there is none."""
    if isinstance(mesh, (tuple, list)) and len(mesh) == 2:
        return _OfArrays(*mesh)
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return _OfTrimesh(mesh)
    if hasattr(mesh, "points") and hasattr(mesh, "celltypes"):
        raise Error(f"{type(mesh).__name__} may have cells of any kind: give its surface, `extract_surface()`")
    if hasattr(mesh, "points") and hasattr(mesh, "cells_dict"):
        return _OfMeshio(mesh)
    if hasattr(mesh, "points") and hasattr(mesh, "faces") and hasattr(mesh, "triangulate"):
        return _OfPyvista(mesh)
    return None


def arrays(vertices: Any, faces: Any) -> Arrays:
    """Vertices in double precision and faces as they are taken by the library, both checked."""
    vertices, faces = reals("vertices", vertices), array("faces", faces)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise Error(f"vertices must be an array of shape (n, 3), not {vertices.shape}")
    if faces.ndim != 2 or faces.shape[1] != 3 or not (np.issubdtype(faces.dtype, np.integer)):
        raise Error(f"faces must be an array of integers of shape (m, 3), not of {faces.dtype} and shape {faces.shape}")
    if len(faces) == 0:
        raise Error("the mesh has no faces")
    lowest, highest = faces.min(), faces.max()
    if lowest < 0 or highest >= len(vertices):
        wrong = lowest if lowest < 0 else highest
        raise Error(f"a face has the vertex {wrong}, and there are vertices from 0 to {len(vertices) - 1}")
    return Arrays(vertices, np.ascontiguousarray(faces, dtype=np.uint32))


def array(name: str, values: Any) -> np.ndarray:
    """An array of anything."""
    try:
        return np.asarray(values)
    except ValueError:
        raise Error(f"`{name}` must be an array, not {type(values).__name__} of parts of different lengths") from None


def reals(name: str, values: Any) -> np.ndarray:
    """An array of numbers in double precision."""
    given = array(name, values)
    if given.dtype.kind not in "biuf":
        raise Error(f"`{name}` must be an array of numbers, not of {given.dtype}")
    return np.ascontiguousarray(given, dtype=np.float64)


def of_path(mesh: Any) -> str | None:
    """The name of a file, a built-in shape or a region."""
    return os.fspath(mesh) if isinstance(mesh, (str, os.PathLike)) else None


class _OfArrays:
    def __init__(self, vertices: Any, faces: Any):
        self.vertices, self.faces = array("vertices", vertices), array("faces", faces)
        self._kinds = self.vertices.dtype, self.faces.dtype

    def moved(self, vertices: np.ndarray) -> Arrays:
        return self.anew(vertices, self.faces)

    def anew(self, vertices: np.ndarray, faces: np.ndarray) -> Arrays:
        of_vertices, of_faces = self._kinds
        if not np.issubdtype(of_vertices, np.floating):
            of_vertices = np.dtype(np.float64)
        if len(vertices) - 1 > np.iinfo(of_faces).max:
            of_faces = np.promote_types(of_faces, np.min_scalar_type(len(vertices) - 1))
        return Arrays(vertices.astype(of_vertices), faces.astype(of_faces))


class _OfTrimesh:
    def __init__(self, mesh: Any):
        self._mesh = mesh
        self.vertices, self.faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)

    def moved(self, vertices: np.ndarray) -> Any:
        moved = self._mesh.copy() if hasattr(self._mesh, "copy") else copy.deepcopy(self._mesh)
        moved.vertices = vertices
        return moved

    def anew(self, vertices: np.ndarray, faces: np.ndarray) -> Any:
        return type(self._mesh)(vertices=vertices, faces=faces.astype(np.int64), process=False)


class _OfPyvista:
    def __init__(self, mesh: Any):
        self._mesh = mesh
        triangles = mesh if mesh.is_all_triangles else mesh.triangulate()
        self.vertices = np.asarray(mesh.points)
        self.faces = np.asarray(triangles.faces).reshape(-1, 4)[:, 1:]

    def moved(self, vertices: np.ndarray) -> Any:
        moved = self._mesh.copy()
        moved.points = vertices.astype(np.asarray(self._mesh.points).dtype)
        return moved

    def anew(self, vertices: np.ndarray, faces: np.ndarray) -> Any:
        return type(self._mesh).from_regular_faces(vertices, faces.astype(np.int64))


class _OfMeshio:
    def __init__(self, mesh: Any):
        self._mesh = mesh
        blocks = {str(kind): cells for kind, cells in mesh.cells_dict.items()}
        faces = [np.asarray(blocks[kind]) for kind in ("triangle",) if kind in blocks]
        if "quad" in blocks:
            quads = np.asarray(blocks["quad"])
            faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
        if not faces:
            raise Error(f"the mesh has no triangles or quadrilaterals, only {', '.join(blocks) or 'nothing'}")
        self.vertices, self.faces = np.asarray(mesh.points), np.concatenate(faces)

    def moved(self, vertices: np.ndarray) -> Any:
        moved = copy.deepcopy(self._mesh)
        moved.points = vertices.astype(np.asarray(self._mesh.points).dtype)
        return moved

    def anew(self, vertices: np.ndarray, faces: np.ndarray) -> Any:
        return type(self._mesh)(vertices, [("triangle", faces.astype(np.int64))])
