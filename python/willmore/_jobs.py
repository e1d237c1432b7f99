"""The jobs."""

from __future__ import annotations

import json
from typing import Any, Iterable, Literal

import numpy as np

from . import _inputs, _meshes, _willmore
from ._flow import Flow
from ._inputs import Source
from ._options import in_memory
from ._progress import Progress, told
from ._results import Result, picture_of, tell
from ._willmore import Error, Input


def fair(
    mesh: Any,
    *,
    noise: float | None = None,
    edges: Literal["auto", "keep", "round"] | None = None,
    max_distance: float | None = None,
    fixed: Any = None,
    volume: Any = "keep",
    area: Any = None,
    reduced_volume: float | None = None,
    energy_ratio: float | None = None,
    energy: float | None = None,
    time: float | None = None,
    steps: int | None = None,
    tolerance: Any = None,
    cells: int | None = None,
    remesh: bool = False,
    repair: bool = False,
    allow_loss: bool = False,
    progress: Progress = False,
    **more: Any,
) -> Result:
    """Takes the noise off a mesh. Its vertices move along the normals; the mesh that came in stays as it is.

    Parameters
    ----------
    mesh
        ``(vertices, faces)``, a mesh of trimesh, pyvista or meshio, or the name of a file. The boundary of one
        that is open does not move.
    noise : float, optional
        Standard deviation of the noise along the normals, in the units of the mesh. By default it is estimated.
    edges : "auto", "keep" or "round", optional
        Whether sharp edges stay sharp where noise is taken off: where the evidence is clear for a closed part of the mesh (auto, the default), also where
        it is weak (keep), or nowhere (round).
    max_distance : float, optional
        Largest distance of the vertices from the mesh that came in, in its units. By default there is no such bound.
    fixed : (n,) array of bool, or str, optional
        The vertices that stay, or a region: ``"box:x0,y0,z0,x1,y1,z1"``, ``"ball:x,y,z,r"``, or the file of a closed mesh.
    volume : "keep", float, "90%" or None
        The volume stays, goes to a value or to a part of it, or is left alone (None).
    area, reduced_volume : optional
        Other sizes that are held, as in `flow`.
    energy_ratio, energy, time, steps : optional
        Stop when the energy is no more than this part of that at the beginning, or no more than this, at a time, or after so many steps, and not when
        the noise is off.
    tolerance : float or str, optional
        Tolerated error of the time steps.
    cells : int, optional
        Cells of the grid per unit length of the box. By default the coarsest of a few grids that holds the thin parts of the mesh.
    remesh : bool
        Return a new mesh, the zero level set on the grid.
    repair : bool
        Repair a mesh that is open, crosses itself or is not oriented alike; it becomes a new mesh.
    allow_loss : bool
        Go on even if the grid is too coarse for thin parts.
    progress : bool or callable
        Show progress, or call ``progress(title, done, parts)``.
    **more
        Other options of ``willmore fair``, with underscores: ``box_side``, ``side_length``, ``tau``, ``network``, ``device`` and so on.

    Returns
    -------
    Result
        ``.mesh`` is of the kind that came in, ``.report["mesh"]`` says how far the vertices have moved.

    Raises
    ------
    Error
        A mesh or an option that is refused, with one line that says what to do.

    Examples
    --------
    >>> import willmore
    >>> smooth = willmore.fair("builtin:cube", steps=2, cells=24)
    >>> smooth.report["energy"] < smooth.report["first_energy"]
    True
    """
    region = _meshes.of_path(fixed)
    source = _inputs.of_shape(mesh, fixed=None if region is not None else fixed)
    if source.mesh is None and _meshes.of_path(mesh) is None:
        raise Error("`fair` takes a mesh: give (vertices, faces), or a mesh of trimesh, pyvista or meshio. `surfaces` takes segmentations, `flow` images and fields")
    if fixed is not None and region is None:
        region = "colour:ff0000"
    ends = any(given is not None for given in (energy_ratio, energy, time, steps))
    if isinstance(volume, str) and volume == "keep" and (not ends or reduced_volume is not None):
        # Where noise is taken off, the volume stays anyway.
        volume = None
    options = {
        "noise": noise,
        "edges": edges,
        "max_distance": max_distance,
        "keep": region,
        "volume": volume,
        "area": area,
        "reduced_volume": reduced_volume,
        "energy_ratio": energy_ratio,
        "energy": energy,
        "time": time,
        "steps": steps,
        "tolerance": tolerance,
        "cells": cells,
        "remesh": remesh or repair,
        "repair": repair,
        "allow_loss": allow_loss,
    }
    return _run("fair", source, {**options, **more}, progress)


def surfaces(
    labels: Any,
    *,
    label: int | Iterable[int] | None = None,
    threshold: float | None = None,
    affine: Any = None,
    spacing: Any = None,
    origin: Any = None,
    detail: float | None = None,
    max_distance: float | None = None,
    volume: Any = "keep",
    cells: int | None = None,
    progress: Progress = False,
    **more: Any,
) -> dict[int, Result]:
    """A smooth closed surface of each label of a segmentation, with the volume of its voxels.

    Parameters
    ----------
    labels : (n, m, k) array, an image of nibabel or pyvista, or the name of a file
        Labels, of which 0 is outside; a mask; or grey values with `threshold`. Each label is smoothed alone: the surfaces of two labels that touch can
        overlap or part by about a voxel. `shared_surfaces` smooths all labels together.
    label : int or sequence of int, optional
        The labels that become surfaces, by default all but 0.
    threshold : float, optional
        Values above are inside. The surface has the key 1.
    affine : (4, 4) array, optional
        From indices of voxels to positions, as in nibabel; by default that of the image.
    spacing, origin : float or three of them, optional
        Sides of a voxel and the centre of the first one, in place of `affine`; by default 1 and 0.
    detail : float, optional
        Details with a smaller radius are smoothed away. By default it is 1.25 voxels.
    max_distance : float, optional
        Largest distance of the vertices from the surface between the voxels. By default it is half a voxel. It wins over `detail`.
    volume : "keep", float, "90%" or None
        The volume of the voxels stays, also that of each part, goes to a value or to a part of it, or is left alone (None).
    cells : int, optional
        Cells of the grid per unit length of the box. By default the grid is as fine as the voxels, if that is possible.
    progress : bool or callable
        Show progress, or call ``progress(title, done, parts)``.
    **more
        Other options of ``willmore fair``, with underscores.

    Returns
    -------
    dict of Result
        By label. ``.mesh`` has two arrays, vertices and faces; ``.to_trimesh()`` and ``.to_pyvista()`` make objects of them. Positions are those
        of the affine map: millimetres for most images of nibabel.

    Raises
    ------
    Error
        No labels, and options that are refused.

    Examples
    --------
    >>> import numpy as np, willmore
    >>> x, y, z = np.mgrid[:20, :20, :20] - 9.5
    >>> ball = willmore.surfaces(x**2 + y**2 + z**2 < 49, spacing=2.0, cells=24)[1]
    >>> bool(abs(ball.report["volume"] / (8 * 1472) - 1) < 0.02)
    True
    """
    options = {"detail": detail, "max_distance": max_distance, "volume": volume, "cells": cells, **more}
    name = _meshes.of_path(labels)
    voxels = None if name is not None else _inputs.of_voxels(labels, affine=affine, spacing=spacing, origin=origin)
    if voxels is None and not (affine is None and spacing is None and origin is None):
        raise Error("a file says itself where its voxels are: leave out `affine`, `spacing` and `origin`")
    source = Source(Input.named(str(name)) if voxels is None else voxels.input())
    if threshold is not None:
        if label is not None:
            raise Error("`threshold` and `label` are two ways to say what is inside: give one of them")
        return {1: _run("fair", source, {**options, "threshold": threshold}, progress)}
    if voxels is None and label is None:
        wanted = _willmore.labels(source.input, in_memory(options))
    else:
        wanted = _labels_of(np.array([]) if voxels is None else voxels.values, label)
    return {one: _run("fair", source, {**options, "label": one}, progress) for one in wanted}


def _labels_of(values: np.ndarray, label: int | Iterable[int] | None) -> list[int]:
    if label is not None:
        several = np.ravel(list(label) if isinstance(label, (set, frozenset)) else _meshes.array("label", label))
        if several.dtype.kind not in "biu" or len(several) == 0:
            raise Error(f"`label` must be a whole number or several of them, not {label!r}")
        if 0 in several:
            raise Error("`label` 0 is outside: give other labels, or a mask such as `labels == 0`")
        return [int(one) for one in several]
    found = np.unique(values)
    if np.any(found != np.round(found)):
        raise Error("these are no labels, which are whole numbers: give `threshold`, above which is inside")
    wanted = [int(one) for one in found if one != 0]
    if not wanted:
        raise Error("all voxels are 0, so that there is no surface")
    return wanted


def flow(
    shape: Any,
    *,
    spacing: float | None = None,
    origin: Any = None,
    field_kind: Literal["phase-field", "distance"] | None = None,
    steps: int | None = None,
    time: float | None = None,
    tolerance: Any = None,
    tau: Any = None,
    stepper: Literal["minimizing", "direct"] | None = None,
    volume: Any = None,
    area: Any = None,
    length: Any = None,
    reduced_volume: float | None = None,
    ramp: int | None = None,
    spontaneous_curvature: float | None = None,
    tension: float | None = None,
    pressure: float | None = None,
    energy: float | None = None,
    cells: int | None = None,
    progress: Progress = False,
    **more: Any,
) -> Flow:
    """Willmore flow, step by step.

    Parameters
    ----------
    shape
        A mesh; an image, which is an array of bool or uint8; a field, which is an array of float with as many nodes along each axis, 1 inside and -1
        outside; the name of a file; or a built-in shape such as ``"builtin:torus"``.
    spacing, origin : optional
        The distance of neighbouring nodes of a field that is an array, and the position of its first node; by default 1 and 0. A field in a file
        fills the box, whose middle is 0.
    field_kind : {"phase-field", "distance"}, optional
        The values of a field: a phase field (default), whose profile across the interface is ``tanh(-3 s / (4 eps))`` at the signed distance ``s``,
        with ``eps`` of two cells; or signed distances, negative inside, of which the package makes one.
    steps : int, optional
        Stop after so many steps; by default 20, with sizes that are held 20 more than `ramp`, or 1000 where something else ends the flow.
    time : float, optional
        Stop at this time, a length to the fourth power.
    tolerance : float or str, optional
        Tolerated error of the time steps: a length for the whole flow, or ``"1.5%"`` of the way in each step, which is the default.
    tau : float or str, optional
        Equal time steps, or another rule: see ``willmore flow --help``.
    stepper : {"minimizing", "direct"}, optional
        Minimizations with the learned operator (default), or direct steps by convolutions. On smooth shapes direct steps are nearer to the exact flow.
        They hold no sizes and have no other terms of the energy than bending.
    volume, area, length : "keep", float or "90%", optional
        Sizes that stay, or that go to a value or to a part of them. In the plane, `area` is that of the inside.
    reduced_volume : float, optional
        The area stays, and the volume goes to this part of that of the ball of the same area.
    ramp : int, optional
        Steps over which sizes go to their targets, by default 20.
    spontaneous_curvature, tension, pressure : float, optional
        Terms of the energy ``1/2 int (kappa - c0)^2 + tension * area + pressure * volume``.
    energy : float, optional
        Stop when the energy is no more than this.
    cells : int, optional
        Cells of the grid per unit length of the box.
    progress : bool or callable
        Show the progress of reading the shape, or call ``progress(title, done, parts)``.
    **more
        Other options of ``willmore flow``, with underscores.

    Returns
    -------
    Flow
        An iterator of `State`. ``.run()`` makes all steps and returns a `Result`.

    Raises
    ------
    Error
        A shape or an option that is refused.

    Examples
    --------
    >>> import willmore
    >>> for state in willmore.flow("builtin:cross", cells=24, steps=2):
    ...     print(state.step, state.energy > 0)
    1 True
    2 True
    """
    source = _inputs.of_shape(shape, spacing=spacing, origin=origin)
    options = {
        "field_kind": field_kind,
        "steps": steps,
        "time": time,
        "tolerance": tolerance,
        "tau": tau,
        "stepper": stepper,
        "volume": volume,
        "area": area,
        "length": length,
        "reduced_volume": reduced_volume,
        "ramp": ramp,
        "spontaneous_curvature": spontaneous_curvature,
        "tension": tension,
        "pressure": pressure,
        "energy": energy,
        "cells": cells,
        **more,
    }
    begun = _willmore.begin("flow", source.input, in_memory({**source.options, **options}), told(progress))
    tell(begun.warnings)
    if source.pixels is not None:
        drawing = picture_of(begun.state.shape)
        source = source if drawing is None else _inputs.coloured(source, drawing)
    return Flow(begun, source)


def energy(shape: Any, *, spontaneous_curvature: float | None = None, cells: int | None = None, **more: Any) -> float:
    """The bending energy ``1/2 int (kappa - c0)^2`` of a shape, as the flow measures it on its grid.

    Parameters
    ----------
    shape, spontaneous_curvature, cells, **more
        As in `flow`.

    Returns
    -------
    float
        A sphere has ``8 pi``, a circle of radius ``R`` has ``pi / R``. Edges and noise count as if they had the radius of the interface width, so that
        more cells give more energy. Compare energies on grids of the same `cells`.

    Raises
    ------
    Error
        As in `flow`.
    """
    begun = flow(shape, spontaneous_curvature=spontaneous_curvature, cells=cells, steps=1, **more)
    next(begun)
    return float(begun.result().report["first_energy"])


def inpaint(
    shape: Any,
    mask: Any,
    *,
    ansatz: str | None = None,
    spacing: float | None = None,
    origin: Any = None,
    field_kind: Literal["phase-field", "distance"] | None = None,
    steps: int | None = None,
    cells: int | None = None,
    progress: Progress = False,
    **more: Any,
) -> Result:
    """Fills a region of a shape smoothly. All that is outside of the region stays, bit for bit in images and fields.

    Parameters
    ----------
    shape
        An image, a mesh, a field or a name, as in `flow`.
    mask : array of bool, or str
        The region: an array of the shape of the image or field, also of one in a file, or ``"box:x0,y0,x1,y1"``, ``"ball:x,y,r"``, in 3D with z. For an
        image, regions are in pixels from the lower left corner.
    ansatz : str, optional
        The shape in the region at the beginning: ``"keep"`` (default), ``"empty"``, ``"full"``, or a region.
    spacing, origin, field_kind, steps, cells, progress, **more
        As in `flow`.

    Returns
    -------
    Result
        ``.image``, ``.mesh`` or ``.field``.

    Raises
    ------
    Error
        A shape, a mask or an option that is refused.
    """
    source = _inputs.of_shape(shape, spacing=spacing, origin=origin)
    options = {"ansatz": ansatz, "field_kind": field_kind, "steps": steps, "cells": cells, **more}
    return _run("inpaint", source, options, progress, mask=_inputs.of_mask(shape, mask, spacing, origin, options))


def repair(mesh: Any) -> Any:
    """A closed mesh of one that is open, crosses itself or is not oriented alike.

    Parameters
    ----------
    mesh
        ``(vertices, faces)``, a mesh of trimesh, pyvista or meshio, or the name of a file.

    Returns
    -------
    mesh
        A new mesh of this kind; `Arrays` of a file.

    Raises
    ------
    Error
        Faces that enclose nothing.

    Warns
    -----
    WillmoreWarning
        What was changed: which part of the area was added to close holes, and which was left out.
    """
    source = _inputs.of_shape(mesh)
    vertices, faces, changes = _willmore.repair(source.input)
    tell([changes])
    if source.mesh is None:
        return _meshes.Arrays(vertices, faces.astype(np.int64))
    return source.mesh.anew(vertices, faces)


def _run(name: str, source: Source, options: dict[str, Any], progress: Progress, mask: Any = None) -> Result:
    results = _willmore.run(name, source.input, in_memory({**source.options, **options}), told(progress), mask)
    tell(results.warnings)
    return Result(results, source)
