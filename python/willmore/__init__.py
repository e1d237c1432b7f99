"""Willmore flow of meshes, segmentations, images and fields.

Willmore flow makes shapes smooth: it is the steepest descent of the bending energy ``1/2 int kappa^2``, where ``kappa`` is the sum of the
principal curvatures.

================= ==================================================================
`fair`            take the noise off a mesh, whose vertices move
`surfaces`        a smooth surface of each label of a segmentation
`shared_surfaces` all labels of a segmentation at once, as `SharedSurfaces`
`flow`            Willmore flow of a mesh, an image or a field, step by step
`inpaint`         fill a region of an image, a mesh or a field smoothly
`repair`          a closed mesh of one that is open or crosses itself
`energy`          the bending energy of a shape
`signed_distance` distances of points from a mesh
`zero_level`      curves or surface of a phase field
`Run`             the folder of a run, which can be resumed
`train_operator`  a learned step of mean curvature flow; `Network` loads one
`exact`           exact references: curves, surfaces of revolution, vesicles
================= ==================================================================

Options are those of the program ``willmore``, with underscores. Lengths are in the units of the input, times in lengths to the fourth power.
"""

from . import exact
from ._flow import Flow, State
from ._jobs import energy, fair, flow, inpaint, repair, surfaces
from ._meshes import Arrays
from ._results import Result, WillmoreWarning
from ._runs import Run
from ._shapes import signed_distance, zero_level
from ._shared import SharedSurfaces, shared_surfaces
from ._training import Network, train_operator
from ._willmore import VERSION as __version__
from ._willmore import Error

__all__ = [
    "Arrays",
    "Error",
    "Flow",
    "Network",
    "Result",
    "Run",
    "SharedSurfaces",
    "State",
    "WillmoreWarning",
    "energy",
    "exact",
    "fair",
    "flow",
    "inpaint",
    "repair",
    "shared_surfaces",
    "signed_distance",
    "surfaces",
    "train_operator",
    "zero_level",
]
