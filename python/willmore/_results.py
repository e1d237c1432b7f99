"""Results of jobs."""

from __future__ import annotations

import json
import os
import sys
import warnings as python_warnings
from functools import cached_property
from typing import Any

import numpy as np

from ._inputs import Source
from ._willmore import Error, Results, Shape, State


class WillmoreWarning(UserWarning):
    """Something that you should know before you trust a result."""


_FOLDER = os.path.join(os.path.dirname(__file__), "")


def tell(messages: list[str]) -> None:
    """Raises the warnings of a job as those of Python, at the line that called this package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_FOLDER):
        level, frame = level + 1, frame.f_back
    for message in messages:
        python_warnings.warn(message, WillmoreWarning, stacklevel=level)


class Shaped:
    """The shape and the phase field of a result or a state."""

    def __init__(self, made: Results | State, source: Source):
        self._made, self._source = made, source

    @cached_property
    def _shape(self) -> Shape:
        return self._made.shape

    @cached_property
    def _field(self) -> tuple[np.ndarray, float, np.ndarray]:
        return field_of(self._made)

    @property
    def field(self) -> np.ndarray:
        return self._field[0]

    @property
    def spacing(self) -> float:
        return self._field[1]

    @property
    def origin(self) -> np.ndarray:
        return self._field[2]

    @cached_property
    def mesh(self) -> Any:
        return mesh_of(self._shape, self._source)

    @cached_property
    def image(self) -> np.ndarray | None:
        return image_of(self._shape, self._source)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the mesh (.ply, .obj, .stl, .off) or the drawing (.png, .svg).

        Parameters
        ----------
        path
            The file. Its ending says the format. A file that is there is written over. Of a mesh that came in as arrays or an object, positions and
            faces are written; ``mesh.export`` of trimesh writes colours, too.

        Raises
        ------
        Error
            A format that the result does not have, and a shape that has vanished.
        OSError
            A file that cannot be written.
        """
        path = os.fspath(path)
        ending = os.path.splitext(path)[1].lstrip(".").lower()
        encoded = self._shape.encode(ending, self._source.mesh is not None)
        with open(path, "wb") as file:
            file.write(encoded)

    def to_trimesh(self) -> Any:
        """The surface as a ``trimesh.Trimesh``: `mesh` itself, if that is one."""
        import trimesh

        mesh = self.mesh
        return mesh if isinstance(mesh, trimesh.Trimesh) else trimesh.Trimesh(*self._triangles(), process=False)

    def to_pyvista(self) -> Any:
        """The surface as a ``pyvista.PolyData``: `mesh` itself, if that is one."""
        import pyvista

        mesh = self.mesh
        return mesh if isinstance(mesh, pyvista.PolyData) else pyvista.PolyData.from_regular_faces(*self._triangles())

    def _triangles(self) -> tuple[np.ndarray, np.ndarray]:
        mesh = self._shape.mesh
        if mesh is None:
            raise Error("there is no surface")
        return mesh[0], mesh[1].astype(np.int64)


class Result(Shaped):
    """What came out of a job.

    Attributes
    ----------
    mesh
        The surface: a copy of the mesh that came in, of the same kind, with its vertices moved; or a new mesh of that kind. `Arrays` for
        other inputs, None for curves.
    image : array or None
        The picture of a curve, of the shape, type and colours of the image that came in; for a mask, a mask. Red, green, blue and opacity for other
        inputs.
    field : array of float
        The phase field, 1 inside and -1 outside.
    spacing, origin
        The side of a cell of the field, and the position of its first node.
    report : dict
        Energies, sizes, displacements, and what the grid holds, by the names of the file ``summary.json`` of a run.
    warnings, notes : list of str
        What you should know before you trust the result, and which choices were made.
    metrics : dict of arrays
        ``step``, ``time``, ``tau`` (the size of the step), ``energy`` (after it), ``area`` and so on, and costs such as ``hvp`` (products with the
        Hessian). ``objective`` is what a step minimizes: the motion and the energy.
    ended : str
        The rule that ended the flow.
    """

    def __init__(self, results: Results, source: Source):
        super().__init__(results, source)
        self._results = results
        self.report: dict[str, Any] = json.loads(results.report)
        self.warnings: list[str] = results.warnings
        self.notes: list[str] = results.notes
        self.ended: str | None = results.ended

    @cached_property
    def metrics(self) -> dict[str, np.ndarray]:
        return columns([row(record) for record in json.loads(self._results.records)])

    def __repr__(self) -> str:
        command, steps = self.report.get("command"), self.report.get("steps")
        return f"<Result of {command}: {steps} steps, {self.ended or 'goes on'}>"


def mesh_of(shape: Shape, source: Source) -> Any:
    """The surface as the kind of mesh that came in."""
    from ._meshes import Arrays

    made = shape.mesh
    if made is None:
        return None
    vertices, faces = made
    kind = source.mesh
    if kind is None:
        return Arrays(vertices, faces.astype(np.int64))
    if np.shape(kind.vertices) == vertices.shape and np.array_equal(kind.faces, faces):
        return kind.moved(vertices)
    return kind.anew(vertices, faces)


def image_of(shape: Shape, source: Source) -> np.ndarray | None:
    """The picture of a curve as the kind of image that came in."""
    picture = picture_of(shape)
    return picture if picture is None or source.image is None else source.image(picture)


def picture_of(shape: Shape) -> np.ndarray | None:
    """Red, green, blue and opacity of the picture of a curve."""
    made = shape.picture
    if made is None:
        return None
    pixels, (width, height) = made
    return pixels.reshape(height, width, 4)


def field_of(of: Any) -> tuple[np.ndarray, float, np.ndarray]:
    """The values of a phase field, its spacing and its origin."""
    values, cells, spacing, origin = of.field
    return values.reshape((cells,) * len(origin)), spacing, np.array(origin)


def flat(record: dict[str, Any]) -> dict[str, Any]:
    """A record whose groups are taken apart. A name that is in a group too has the value outside of it."""
    own = {name: value for name, value in record.items() if not isinstance(value, (dict, list))}
    inner: dict[str, Any] = {}
    for group in record.values():
        if isinstance(group, dict):
            inner.update(flat(group))
    return {**own, **inner, **own}


def row(record: dict[str, Any]) -> dict[str, Any]:
    """The numbers of a step by their names, as in ``metrics.csv``."""
    values = flat(record)
    made = record.get("minimization")
    if made is not None:
        # Products with the Hessian are also made by the first guess, and by steps that were refused.
        values["hvp"] = record.get("refused_hvp", 0) + made["start"]["hvp"] + made["newton"]["hvp"]
    return renamed(values)


def renamed(values: dict[str, Any]) -> dict[str, Any]:
    """The energy of the shape is called so, and what a step minimizes is its objective."""
    names = {"energy": "objective", "energy_before": "objective_before", "willmore_energy": "energy"}
    return {names.get(name, name): value for name, value in values.items()}


def columns(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    """Rows as arrays by their names. Numbers that a row does not have are NaN."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> np.ndarray:
    if any(value is None for value in values):
        values = [np.nan if value is None else value for value in values]
    return np.array(values)
