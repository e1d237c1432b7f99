"""Exact references: flows of plane curves and of surfaces of revolution, and vesicles in equilibrium.

Curves are accurate to about 1e-8 of their size, surfaces to about 1e-6. `Shape` makes the shapes that flows begin with.
"""

from __future__ import annotations

from typing import Literal, Sequence, overload

import numpy as np

from . import _willmore

Curve = _willmore.Curve
Surface = _willmore.Surface
Vesicle = _willmore.Vesicle
Shape = _willmore.ExactShape

__all__ = [
    "Curve",
    "Shape",
    "Surface",
    "Vesicle",
    "circle_radius",
    "curve_flow",
    "revolution_flow",
    "vesicle",
]

_FlowName = Literal["willmore", "mean-curvature"]
_Branch = Literal["prolate", "oblate", "stomatocyte"]


def curve_flow(
    shape: Shape, times: Sequence[float], *, flow: _FlowName = "willmore", tolerance: float | None = None
) -> list[Curve]:
    """A plane curve at increasing times.

    Parameters
    ----------
    shape : Shape
        The curve at time 0, such as ``Shape.ellipse(0.3, 0.2)``.
    times : sequence of float
        They increase. For a polygon they begin after its corners are round.
    flow : {"willmore", "mean-curvature"}
        Willmore flow, with the normal velocity ``kappa_ss + kappa^3 / 2``, or curve shortening.
    tolerance : float, optional
        Root mean square of the error of the tangent angle in one time step, by default 1e-10.

    Returns
    -------
    list of Curve
        Each has ``time``, ``length``, ``area``, ``energy`` (``1/2 int kappa^2 ds``) and ``points``, an array of shape (n, 2).

    Raises
    ------
    Error
        Times that do not increase, and singularities.

    Examples
    --------
    >>> from willmore import exact
    >>> circle, = exact.curve_flow(exact.Shape.circle((0, 0), 0.5), [0.01])
    >>> round(circle.length / (2 * 3.141592653589793), 6) == round(exact.circle_radius(0.5, 0.01), 6)
    True
    """
    return _willmore.exact_curves(shape, list(map(float, times)), flow, tolerance)


def revolution_flow(
    shape: Shape, times: Sequence[float], *, flow: _FlowName = "willmore", tolerance: float | None = None
) -> list[Surface]:
    """A surface of revolution about the y axis at increasing times.

    Parameters
    ----------
    shape : Shape
        Its outline at time 0: symmetric about the y axis, or beside it for a torus.
    times : sequence of float
        They increase.
    flow : {"willmore", "mean-curvature"}
        The flow.
    tolerance : float, optional
        Root mean square of the error of the tangent angle in one time step, by default 1e-7.

    Returns
    -------
    list of Surface
        Each has ``time``, ``area``, ``volume``, ``energy`` (``1/2 int kappa^2 dA``, 8 pi for a sphere), ``reduced_volume`` and ``profile``, the
        outline as an array of shape (n, 2).

    Raises
    ------
    Error
        Shapes that are not symmetric, times that do not increase, and singularities.
    """
    return _willmore.exact_surfaces(shape, list(map(float, times)), flow, tolerance)


@overload
def vesicle(
    reduced_volume: float, *, branch: _Branch = "oblate", spontaneous_curvature: float = 0.0
) -> Vesicle: ...
@overload
def vesicle(
    reduced_volume: Sequence[float], *, branch: _Branch = "oblate", spontaneous_curvature: float = 0.0
) -> list[Vesicle]: ...
def vesicle(
    reduced_volume: float | Sequence[float], *, branch: _Branch = "oblate", spontaneous_curvature: float = 0.0
) -> Vesicle | list[Vesicle]:
    """Axisymmetric vesicles in equilibrium, of area ``4 pi``.

    Parameters
    ----------
    reduced_volume : float or sequence of float
        The volume over that of the ball of the same area, between 0 and 1. A red blood cell has 0.64.
    branch : {"prolate", "oblate", "stomatocyte"}
        Cigars and dumbbells, red blood cells, or cups.
    spontaneous_curvature : float
        ``c0`` in the energy ``1/2 int (kappa - c0)^2``, in units of the inverse radius of that ball.

    Returns
    -------
    Vesicle, or a list of them
        Each has ``energy``, ``pressure``, ``tension`` and ``surface``.

    Raises
    ------
    Error
        Reduced volumes beyond the ends of the branch.

    Examples
    --------
    >>> from willmore import exact
    >>> cell = exact.vesicle(0.65)
    >>> round(cell.energy / (8 * 3.141592653589793), 4)
    1.8262
    """
    several = np.ndim(reduced_volume) > 0
    volumes = [float(volume) for volume in np.atleast_1d(reduced_volume)]
    vesicles = _willmore.exact_vesicles(volumes, branch, float(spontaneous_curvature))
    return vesicles if several else vesicles[0]


def circle_radius(radius: float, time: float) -> float:
    """The radius of a circle under Willmore flow, ``(R^4 + 2 t)^(1/4)``.

    Parameters
    ----------
    radius : float
        The radius ``R`` at time 0.
    time : float
        The time ``t``.

    Returns
    -------
    float
    """
    return float((radius**4 + 2.0 * time) ** 0.25)
