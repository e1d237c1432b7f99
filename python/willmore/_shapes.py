"""Distances and level sets."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _inputs, _meshes, _willmore
from ._willmore import Error


def signed_distance(mesh: Any, points: Any) -> np.ndarray:
    """The signed distances of points from a closed mesh.

    Parameters
    ----------
    mesh
        ``(vertices, faces)``, or a mesh of trimesh, pyvista or meshio. It must be closed.
    points : (..., 3) array of float
        In the coordinates of the mesh.

    Returns
    -------
    (...) array of float
        Negative inside.

    Raises
    ------
    Error
        A mesh that is not closed; `repair` makes one that is.
    """
    kind = _meshes.of(mesh)
    if kind is None:
        raise Error(f"{type(mesh).__name__} is no mesh")
    points = _meshes.reals("points", points)
    if points.shape[-1:] != (3,):
        raise Error(f"`points` must be an array of shape (..., 3), not {points.shape}")
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    distances = _willmore.signed_distances(*_meshes.arrays(kind.vertices, kind.faces), flat)
    return distances.reshape(points.shape[:-1])


def zero_level(field: Any, *, spacing: float = 1.0, origin: Any = 0.0) -> Any:
    """The curves or the surface where a field on a periodic cubic grid is zero.

    Parameters
    ----------
    field : (n, n) or (n, n, n) array of float
        Positive inside, as a phase field. The first axis is x.
    spacing : float
        The distance of neighbouring nodes.
    origin : float or sequence of float
        The position of the first node.

    Returns
    -------
    list of (m, 2) arrays, or Arrays
        Closed curves in the plane, a closed surface in space.

    Raises
    ------
    Error
        A field that is positive everywhere or nowhere.
    """
    values = _meshes.reals("field", field)
    if values.ndim not in (2, 3) or len(set(values.shape)) != 1:
        raise Error(f"a field has two or three axes with as many nodes along each, not the shape {values.shape}")
    if not values.size or not values.min() <= 0 < values.max():
        raise Error("the field has no zero level: it is positive everywhere or nowhere, or not finite")
    side, first = _inputs.numbers("spacing", spacing, 1)[0], _inputs.numbers("origin", origin, values.ndim)
    if values.ndim == 2:
        return _willmore.zero_curves(values, side, first)
    vertices, faces = _willmore.zero_surface(values, side, first)
    return _meshes.Arrays(vertices, faces.astype(np.int64))
