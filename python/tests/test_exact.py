"""Exact references."""

import numpy as np
import pytest
import willmore
from willmore import exact


def test_circles():
    circle = exact.Shape.circle((1, 2), 0.5)
    curves = exact.curve_flow(circle, [0, 0.01, 0.1])
    for curve, time in zip(curves, (0, 0.01, 0.1)):
        radius = exact.circle_radius(0.5, time)
        assert curve.time == time
        assert curve.length == pytest.approx(2 * np.pi * radius, rel=1e-7)
        assert curve.area == pytest.approx(np.pi * radius**2, rel=1e-7)
        assert curve.energy == pytest.approx(np.pi / radius, rel=1e-7)
        assert np.linalg.norm(curve.points - [1, 2], axis=1) == pytest.approx(radius, rel=1e-6)
    (shorter,) = exact.curve_flow(circle, [0.05], flow="mean-curvature")
    assert shorter.length == pytest.approx(2 * np.pi * np.sqrt(0.25 - 2 * 0.05), rel=1e-6)


def test_curves_of_points():
    corners = [[0, 0], [2, 0], [2, 1], [0, 1]]
    of_list, of_array = (exact.curve_flow(exact.Shape.polygon(points), [1e-3])[0] for points in (corners, np.array(corners)))
    assert of_list.length == of_array.length < 6
    angle = np.arange(64) * 2 * np.pi / 64
    points = np.stack([0.3 * np.cos(angle), 0.2 * np.sin(angle)], axis=1)
    smooth, ellipse = (exact.curve_flow(shape, [1e-4])[0] for shape in (exact.Shape.smooth(points), exact.Shape.ellipse(0.3, 0.2)))
    assert smooth.area == pytest.approx(ellipse.area, rel=1e-6) and smooth.energy == pytest.approx(ellipse.energy, rel=1e-5)


def test_ellipsoids():
    start, later = exact.revolution_flow(exact.Shape.ellipse(0.3, 0.2), [0, 1e-3])
    assert start.volume == pytest.approx(4 / 3 * np.pi * 0.3**2 * 0.2, rel=1e-6)
    eccentricity = np.sqrt(1 - (2 / 3) ** 2)
    area = 2 * np.pi * 0.3**2 * (1 + (1 - eccentricity**2) / eccentricity * np.arctanh(eccentricity))
    assert start.area == pytest.approx(area, rel=1e-6)
    assert start.reduced_volume == pytest.approx(6 * np.sqrt(np.pi) * start.volume / area**1.5, rel=1e-6)
    assert 8 * np.pi < later.energy < start.energy and later.reduced_volume > start.reduced_volume
    assert later.profile.shape[1] == 2
    (sphere,) = exact.revolution_flow(exact.Shape.circle((0, 0), 1), [0.1])
    assert sphere.energy == pytest.approx(8 * np.pi, rel=1e-6) and sphere.area == pytest.approx(4 * np.pi, rel=1e-6)


def test_vesicles():
    cell = exact.vesicle(0.65)
    assert cell.energy / (8 * np.pi) == pytest.approx(1.8262, abs=1e-4)
    assert cell.surface.area == pytest.approx(4 * np.pi, rel=1e-4)
    assert cell.surface.reduced_volume == pytest.approx(0.65, rel=1e-4)
    several = exact.vesicle([0.9, 0.8], branch="prolate")
    assert [vesicle.surface.reduced_volume for vesicle in several] == pytest.approx([0.9, 0.8], rel=1e-4)
    assert several[0].energy < several[1].energy < exact.vesicle(0.8).energy


@pytest.mark.parametrize(
    "act",
    [
        lambda: exact.Shape.circle((0, 0), -1),
        lambda: exact.Shape.circle((0, 0), np.nan),
        lambda: exact.Shape.ellipse(0, 1),
        lambda: exact.Shape.polygon(np.zeros((0, 2))),
        lambda: exact.Shape.polygon(np.zeros((3, 1))),
        lambda: exact.Shape.polygon(np.zeros((4, 3))),
        lambda: exact.Shape.polygon(np.full((4, 2), np.nan)),
        lambda: exact.Shape.smooth(np.zeros((3, 1))),
        lambda: exact.Shape.smooth(np.zeros((4, 2))),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 1), [0.2, 0.1]),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 1), [np.nan]),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 1), [-1]),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 1), [1], flow="ricci"),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 1), [1], tolerance=0),
        lambda: exact.curve_flow(exact.Shape.circle((0, 0), 0.1), [1], flow="mean-curvature"),
        lambda: exact.revolution_flow(exact.Shape.circle((0.5, 0), 1), [0.1]),
        lambda: exact.vesicle(1.5),
        lambda: exact.vesicle(0),
        lambda: exact.vesicle(np.nan),
        lambda: exact.vesicle(0.1),
        lambda: exact.vesicle(0.65, branch="cigar"),
    ],
)
def test_refused(act):
    with pytest.raises(willmore.Error) as refused:
        act()
    assert "\n" not in str(refused.value)
