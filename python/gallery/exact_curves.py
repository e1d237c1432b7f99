"""Willmore flow of a flower: the computed curves lie on the exact ones."""

import numpy as np
import willmore
from _drawing import BLUE, GREEN, GREY, ORANGE, RED, panels, save
from matplotlib.path import Path
from willmore import exact

# A flower as a curve, and as its distances on a grid, negative inside.
angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
radius = 0.45 + 0.12 * np.cos(5 * angle)
outline = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
spacing = 1 / 64
x, y = np.meshgrid(*2 * [np.arange(-1, 1, spacing)], indexing="ij")
inside = Path(outline).contains_points(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
distance = np.min([np.hypot(x - a, y - b) for a, b in outline], axis=0) * np.where(inside, -1, 1)

flow = willmore.flow(distance, field_kind="distance", spacing=spacing, origin=-1, time=4e-3)
states = list(flow)
times = [state.time for state in states]
curves = exact.curve_flow(exact.Shape.smooth(outline), times)
between = exact.curve_flow(exact.Shape.smooth(outline), np.geomspace(times[0], times[-1], 100))
print(flow, len(states))

figure, (left, right) = panels([1, 1])
left.fill(*outline.T, color="#dddddd", label="t = 0")
for index, colour in zip((1, 3, 4, len(states) - 1), (ORANGE, GREEN, RED, BLUE)):
    left.plot(*np.vstack([curves[index].points, curves[index].points[:1]]).T, "-", color=GREY, linewidth=1)
    (points,) = states[index].curves
    left.plot(*points[::6].T, ".", color=colour, label=f"t = {states[index].time:.1e}")
left.set(aspect="equal", xlim=(-0.6, 0.65), ylim=(-0.6, 0.95), xlabel="x", ylabel="y", title="computed (dots), exact (lines)")
left.legend(loc="upper center", ncols=2)
right.loglog([curve.time for curve in between], [curve.energy for curve in between], "-", color=GREY, label="exact")
right.loglog(times, [state.energy for state in states], "o", color=BLUE, label="computed")
right.set(xlabel="time (length$^4$)", ylabel="Willmore energy (1 / length)", title="energy")
right.set_yticks([5, 10, 20, 50], ["5", "10", "20", "50"])
right.yaxis.set_minor_formatter("")
right.legend()
save(figure, __file__)
