"""What a job starts from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Callable, NamedTuple

import numpy as np

from . import _meshes
from ._willmore import Error, Input


@dataclass
class Source:
    """An input of the library, and how results become the kind of object that came in; of an image its own red, green, blue and opacity."""

    input: Input
    options: dict[str, Any] = field(default_factory=dict)
    mesh: _meshes.Kind | None = None
    image: Callable[[np.ndarray], np.ndarray] | None = None
    pixels: np.ndarray | None = None


def of_shape(shape: Any, *, spacing: Any = None, origin: Any = None, fixed: Any = None) -> Source:
    """A mesh, an image, a field, or a name."""
    source = _without_nodes(shape, fixed)
    if source is not None:
        if not (spacing is None and origin is None):
            raise Error("`spacing` and `origin` are for a field that is an array, which this shape is not: leave them out")
        return source
    array = _meshes.array("shape", shape)
    if np.issubdtype(array.dtype, np.floating) and array.ndim in (2, 3):
        return Source(of_field(array, spacing, origin))
    if array.ndim == 3 and array.dtype != object:
        raise Error(f"an array of {array.dtype} in three dimensions holds voxels: `surfaces` makes smooth surfaces of them")
    raise Error(
        f"{type(shape).__name__} is no shape: give a mesh, (vertices, faces), an image (bool or uint8), a field (float, two or three dimensions), "
        'or a name such as "scan.ply" or "builtin:torus"'
    )


def _without_nodes(shape: Any, fixed: Any) -> Source | None:
    """A name, a mesh or an image, which say themselves where they are; None for anything else."""
    name = _meshes.of_path(shape)
    if name is not None:
        if fixed is not None:
            raise Error("`fixed` of a mesh that has a name must be a region: for an array, read the mesh first")
        return Source(Input.named(name))
    mesh = _meshes.of(shape)
    if mesh is not None:
        return Source(_of_mesh(mesh, fixed), mesh=mesh)
    if hasattr(shape, "dataobj") and hasattr(shape, "affine"):
        raise Error("this is a volume of voxels: `surfaces` makes smooth surfaces of it")
    array = _meshes.array("shape", shape)
    if array.dtype == np.bool_ and array.ndim == 2:
        return _of_mask(array)
    if array.dtype == np.uint8 and (array.ndim == 2 or array.ndim == 3 and array.shape[2] in (3, 4)):
        own = pixels(array)
        return Source(Input.picture(own), image=_as_image(array), pixels=own)
    return None


def _of_mesh(mesh: _meshes.Kind, fixed: Any) -> Input:
    vertices, faces = _meshes.arrays(mesh.vertices, mesh.faces)
    if fixed is None:
        return Input.mesh(vertices, faces)
    fixed = _meshes.array("fixed", fixed)
    if fixed.dtype != np.bool_:
        raise Error(f"`fixed` must be an array of bool, not of {fixed.dtype}; from indices: mask = np.zeros(n, bool); mask[indices] = True")
    fixed = np.ascontiguousarray(fixed)
    if fixed.shape != (len(vertices),):
        raise Error(f"`fixed` must have one value for each of the {len(vertices)} vertices, not the shape {fixed.shape}")
    return Input.mesh(vertices, faces, fixed)


def of_field(values: Any, spacing: Any, origin: Any) -> Input:
    """A field on a cubic grid."""
    values = np.ascontiguousarray(values, dtype=np.float64)
    if len(set(values.shape)) != 1:
        raise Error(f"a field has as many cells along each axis, not {' x '.join(map(str, values.shape))}: pad it with -1")
    side = 1.0 if spacing is None else numbers("spacing", spacing, 1)[0]
    first = numbers("origin", 0.0 if origin is None else origin, values.ndim)
    make = Input.plane if values.ndim == 2 else Input.space
    return make(values, side, first)


def numbers(name: str, given: Any, count: int) -> list[float]:
    """So many numbers, or one in place of all of them."""
    values = _meshes.reals(name, given)
    if values.size not in (1, count):
        raise Error(f"`{name}` must be a number{f' or {count} numbers' if count > 1 else ''}, not an array of shape {values.shape}")
    return [float(value) for value in np.broadcast_to(values.ravel(), (count,))]


def pixels(image: np.ndarray) -> np.ndarray:
    """Red, green, blue and opacity of an image, or black where a mask is true."""
    if image.dtype == np.bool_:
        image = np.where(image, 0, 255).astype(np.uint8)
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    if image.shape[2] == 3:
        image = np.concatenate([image, np.full((*image.shape[:2], 1), 255, dtype=np.uint8)], axis=2)
    return np.ascontiguousarray(image)


def _of_mask(mask: np.ndarray) -> Source:
    def back(picture: np.ndarray) -> np.ndarray:
        return (picture[:, :, 3] >= 128) & (picture[:, :, 0] < 128)

    return Source(Input.picture(pixels(mask)), options={"inside": "dark"}, image=back)


def _as_image(image: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    if image.ndim == 2:
        return lambda picture: np.ascontiguousarray(picture[:, :, 0])
    return lambda picture: np.ascontiguousarray(picture[:, :, : image.shape[2]])


def coloured(source: Source, drawing: np.ndarray) -> Source:
    """With pictures in the colours that the image has inside and outside of its shape, which is where the drawing is black."""
    back, own = source.image, source.pixels
    if back is None or own is None:
        return source
    ink, paper = (_usual(own[drawing[:, :, 0] == tone], tone) for tone in (0, 255))

    def paint(picture: np.ndarray) -> np.ndarray:
        part = 1.0 - picture[:, :, :1] / 255.0
        mixed: np.ndarray = part * ink + (1.0 - part) * paper
        mixed[:, :, :3] /= mixed[:, :, 3:]
        return mixed.round().astype(np.uint8)

    return replace(source, image=lambda picture: back(paint(picture)))


def _usual(pixels: np.ndarray, tone: int) -> np.ndarray:
    """The usual colour of pixels, or black or white; red, green and blue times the opacity, so that it can be mixed."""
    colour = np.median(pixels, axis=0) if len(pixels) else np.array([tone, tone, tone, 255.0])
    opacity = max(colour[3], 1e-6)
    return np.array([*(colour[:3] * opacity), opacity])


class _Nodes(NamedTuple):
    """How many nodes a field has along each axis, and where they are."""

    shape: tuple[int, ...]
    spacing: Any
    origin: Any


def _nodes(shape: Any, spacing: Any, origin: Any, options: dict[str, Any]) -> _Nodes | None:
    """The nodes of a field, which is an array or a file; None for shapes of other kinds."""
    name = _meshes.of_path(shape)
    if name is not None:
        return _nodes_of_file(name, options)
    if _meshes.of(shape) is not None or not np.issubdtype(np.asarray(shape).dtype, np.floating):
        return None
    return _Nodes(np.shape(shape), spacing, origin)


def _nodes_of_file(name: str, options: dict[str, Any]) -> _Nodes | None:
    """The nodes of a field in a file. They fill the box, which is about 0."""
    try:
        values = np.lib.format.open_memmap(name, mode="r") if name.lower().endswith(".npy") else None
    except (OSError, ValueError):
        # The library says what is wrong with it.
        return None
    given = {option.replace("-", "_"): value for option, value in options.items() if value is not None}
    if values is None or not np.issubdtype(values.dtype, np.floating) or values.ndim not in (2, 3) or _is_volume(values, given):
        return None
    # The default is that of the option.
    side = numbers("box_side", given.get("box_side", 2.0 if values.ndim == 2 else 1.0), 1)[0]
    return _Nodes(values.shape, side / max(values.shape[0], 1), -0.5 * side)


def _is_volume(values: np.ndarray, given: dict[str, Any]) -> bool:
    """Whether the library takes values in a file as those of voxels."""
    if values.ndim == 2 or "field_kind" in given:
        return False
    return "threshold" in given or "label" in given or bool(((values == 0) | (values == 1)).all())


def of_mask(shape: Any, mask: Any, spacing: Any, origin: Any, options: dict[str, Any]) -> Input:
    """The region of an inpainting with these options: a name, or an array of the shape of the image or the field."""
    name = _meshes.of_path(mask)
    if name is not None:
        return Input.named(name)
    mask = _meshes.array("mask", mask)
    if mask.dtype != np.bool_ or mask.ndim not in (2, 3):
        raise Error(f"`mask` must be an array of bool, or a region such as 'box:0,0,10,10', not {mask.dtype} of shape {mask.shape}")
    if not mask.any():
        raise Error("`mask` is true nowhere: there is no region to fill")
    if mask.all():
        raise Error("`mask` is true everywhere: nothing is left that could continue into the region")
    nodes = _nodes(shape, spacing, origin, options)
    if nodes is not None:
        if mask.shape != nodes.shape:
            raise Error(f"`mask` has the shape {mask.shape}; it must have that of the field, {nodes.shape}")
        return of_field(np.where(mask, -1.0, 1.0), nodes.spacing, nodes.origin)
    if mask.ndim == 3:
        raise Error("`mask` of a shape in space is a region such as 'ball:x,y,z,r', or an array of the shape of a field")
    ink = np.zeros((*mask.shape, 4), dtype=np.uint8)
    ink[mask, 3] = 255
    return Input.picture(ink)


@dataclass
class Voxels:
    """Values of voxels and where they are."""

    values: np.ndarray
    affine: np.ndarray

    def input(self) -> Input:
        flat = self.values.ravel(order="F")
        return Input.volume(list(self.values.shape), self.affine.tolist(), flat)


def of_segmentation(labels: Any, *, affine: Any = None, spacing: Any = None, origin: Any = None) -> Input:
    """A file by its name, or voxels."""
    name = _meshes.of_path(labels)
    if name is None:
        return of_voxels(labels, affine=affine, spacing=spacing, origin=origin).input()
    if not (affine is None and spacing is None and origin is None):
        raise Error("a file says itself where its voxels are: leave out `affine`, `spacing` and `origin`")
    return Input.named(str(name))


def of_voxels(labels: Any, *, affine: Any = None, spacing: Any = None, origin: Any = None) -> Voxels:
    """An array, or the image of nibabel or pyvista."""
    if hasattr(labels, "dataobj") and hasattr(labels, "affine"):
        affine = labels.affine if affine is None else affine
        values = np.asanyarray(labels.dataobj)
    elif hasattr(labels, "dimensions") and hasattr(labels, "point_data"):
        values, of_grid = _of_grid(labels)
        affine = of_grid if affine is None else affine
    else:
        values = _meshes.array("labels", labels)
    if values.ndim == 4 and values.shape[3] == 1:
        values = values[:, :, :, 0]
    if values.ndim != 3:
        raise Error(f"a segmentation has three dimensions, not the shape {values.shape}")
    return Voxels(_plain(values), _affine(affine, spacing, origin))


def _of_grid(grid: Any) -> tuple[np.ndarray, np.ndarray]:
    if not hasattr(grid, "spacing"):
        raise Error(f"{type(grid).__name__} has voxels of many shapes: give an ImageData")
    scalars = grid.active_scalars
    if scalars is None or np.ndim(scalars) != 1:
        raise Error("the grid has no active scalars with one value for each voxel")
    dimensions, first = np.array(grid.dimensions), np.array(grid.extent[::2], dtype=float)
    if grid.active_scalars_info.association.name == "CELL":
        dimensions, first = dimensions - 1, first + 0.5
    axes = np.asarray(getattr(grid, "direction_matrix", np.eye(3))) * np.asarray(grid.spacing)
    affine = np.column_stack([axes, axes @ first + np.asarray(grid.origin)])
    return np.asarray(scalars).reshape(dimensions, order="F"), affine


def _plain(values: np.ndarray) -> np.ndarray:
    """The values in one of the kinds that the library takes."""
    if values.dtype in (np.bool_, np.uint8):
        return values.astype(np.uint8)
    if np.issubdtype(values.dtype, np.integer):
        limits = np.iinfo(np.int32)
        if values.size and (values.min() < limits.min or values.max() > limits.max):
            raise Error(f"labels must be from {limits.min} to {limits.max}")
        return values.astype(np.int32)
    if values.dtype in (np.float16, np.float32):
        return values.astype(np.float32)
    if np.issubdtype(values.dtype, np.floating):
        return values.astype(np.float64)
    raise Error(f"voxels of {values.dtype} are no labels and no grey values")


def _affine(affine: Any, spacing: Any, origin: Any) -> np.ndarray:
    if affine is not None:
        if spacing is not None or origin is not None:
            raise Error("`affine` says where the voxels are: leave out `spacing` and `origin`")
        affine = _meshes.reals("affine", affine)
        if affine.shape not in ((3, 4), (4, 4)):
            raise Error(f"`affine` must be an array of shape (4, 4), not {affine.shape}")
        return np.array(affine[:3])
    sides = numbers("spacing", 1.0 if spacing is None else spacing, 3)
    first = numbers("origin", 0.0 if origin is None else origin, 3)
    return np.column_stack([np.diag(sides), first])
