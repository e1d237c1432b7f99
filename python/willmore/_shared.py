"""All labels of a segmentation at once, with shared walls."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from . import _inputs, _meshes, _willmore
from ._options import in_memory
from ._progress import Progress, told
from ._results import tell
from ._willmore import Error


class SharedSurfaces:
    """Smooth labels that fill space: their walls, each of them once.

    Attributes
    ----------
    vertices, faces : arrays
        All walls as one mesh.
    sides : (m, 2) array of int
        For every face the labels behind and ahead of it: its normal points from the first to the second. 0 is the background.
    labels : (n, m, k) array of int
        The smooth labels in the voxels that came in.
    report : dict
        Volumes of the labels before and after, and how far the walls have moved.
    warnings, notes : list of str
        What you should know before you trust the result, and which choices were made.
    """

    def __init__(self, made: _willmore.SharedLabels):
        self._made = made
        self.vertices, faces = made.walls
        self.faces = faces.astype(np.int64)
        self.sides = made.sides
        values, size = made.voxels
        self.labels = values.reshape(size, order="F")
        self.report: dict[str, Any] = json.loads(made.report)
        self.warnings: list[str] = made.warnings
        self.notes: list[str] = made.notes

    def surface(self, label: int) -> _meshes.Arrays:
        """The closed surface of one label. On a wall it has the vertices of its neighbour.

        Parameters
        ----------
        label : int
            One of the labels.

        Returns
        -------
        Arrays
            Vertices and faces.
        """
        surface = self._made.surface(int(label))
        if surface is None:
            raise Error(f"there is no label {label}: the labels are {[one['label'] for one in self.report['labels']]}")
        return _meshes.Arrays(surface[0], surface[1].astype(np.int64))

    def to_pyvista(self) -> Any:
        """All walls as a ``pyvista.PolyData``, whose cells have the array ``BoundaryLabels`` with the labels behind and ahead of them."""
        import pyvista

        # The type of its argument has no widths of integers.
        faces: Any = self.faces
        walls = pyvista.PolyData.from_regular_faces(self.vertices, faces)
        walls.cell_data["BoundaryLabels"] = self.sides
        return walls

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the walls (.ply, .obj), a mesh of each label (.stl), or the smooth labels in their voxels (.nii, .nii.gz).

        Parameters
        ----------
        path
            The file. A file that is there is written over. For .stl the name of each label is added.

        Raises
        ------
        Error
            Another kind of file, or one that cannot be written.
        """
        self._made.save(os.path.abspath(os.fspath(path)))

    def __repr__(self) -> str:
        return f"<willmore.SharedSurfaces of {len(self.report['labels'])} labels, {len(self.faces)} faces>"


def shared_surfaces(
    labels: Any,
    *,
    affine: Any = None,
    spacing: Any = None,
    origin: Any = None,
    detail: float | None = None,
    max_distance: float | None = None,
    cells: int | None = None,
    progress: Progress = False,
    **more: Any,
) -> SharedSurfaces:
    """All labels of a segmentation smoothed together, so that neighbours share their walls.

    Every point belongs to one label, of which 0 is the background: there are no gaps and no overlaps. Each label keeps the volume of its voxels.
    `surfaces` smooths each label alone.

    Parameters
    ----------
    labels : (n, m, k) array, an image of nibabel or pyvista, or the name of a file
        Labels.
    affine : (4, 4) array, optional
        From indices of voxels to positions, as in nibabel; by default that of the image.
    spacing, origin : float or three of them, optional
        Sides of a voxel and the centre of the first one, in place of `affine`; by default 1 and 0.
    detail : float, optional
        Details with a smaller radius are smoothed away. By default it is 1.25 voxels.
    max_distance : float, optional
        Largest distance of the vertices from the surfaces between the voxels. By default it is half a voxel. It wins over `detail`.
    cells : int, optional
        Cells of the grid per unit length of the box. By default the grid is as fine as the voxels, if that is possible.
    progress : bool or callable
        Show progress, or call ``progress(title, done, parts)``.
    **more
        Other options of ``willmore fair``, with underscores.

    Returns
    -------
    SharedSurfaces
        ``.vertices``, ``.faces`` and ``.sides`` are all walls, ``.surface(label)`` is the closed surface of one label.

    Raises
    ------
    Error
        No labels, and options that are refused.

    Examples
    --------
    >>> import numpy as np, willmore
    >>> x, y, z = np.mgrid[:16, :16, :16] - 7.5
    >>> halves = (x**2 + y**2 + z**2 < 36) * np.where(x < 0, 1, 2)
    >>> walls = willmore.shared_surfaces(halves, cells=24, steps=2)
    >>> sorted({tuple(pair) for pair in walls.sides.tolist()})
    [(1, 0), (1, 2), (2, 0)]
    """
    source = _inputs.of_segmentation(labels, affine=affine, spacing=spacing, origin=origin)
    options = {"label": "all", "shared": True, "detail": detail, "max_distance": max_distance, "cells": cells, **more}
    made = _willmore.shared_labels(source, in_memory(options), told(progress))
    tell(made.warnings)
    return SharedSurfaces(made)
