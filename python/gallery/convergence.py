"""The error of Willmore flow against the exact curve falls with the square of the grid spacing."""

import numpy as np
import willmore
from _drawing import BLUE, GREEN, GREY, ORANGE, RED, panels, save
from willmore import exact

# An ellipse: its distances at the nodes of a grid, and the exact curve at a time.
A, B, TIME = 0.5, 0.3, 5e-3
angle = np.linspace(0, 2 * np.pi, 4000, endpoint=False)
ellipse = np.column_stack([A * np.cos(angle), B * np.sin(angle)])
(curve,) = exact.curve_flow(exact.Shape.ellipse(A, B), [TIME])
modes = np.fft.fft(curve.points @ [1, 1j])
half = len(modes) // 2
fine = np.fft.ifft(np.concatenate([modes[:half], np.zeros(4000), modes[half:]])) * (1 + 4000 / len(modes))


def computed(cells):
    """The computed curve at this time, and the root mean square of its distances from the exact one."""
    spacing = 2 / cells
    x, y = np.meshgrid(*2 * [np.arange(cells) * spacing - 1], indexing="ij")
    distance = np.min([np.hypot(x - a, y - b) for a, b in ellipse], axis=0) * np.sign((x / A) ** 2 + (y / B) ** 2 - 1)
    states = willmore.flow(distance, field_kind="distance", spacing=spacing, origin=-1, time=TIME, tolerance="0.3%")
    (points,) = list(states)[-1].curves
    distances = [np.abs(fine - point).min() for point in points @ [1, 1j]]
    return points, np.sqrt(np.mean(np.square(distances)))


figure, (left, right) = panels([1, 1])
left.plot(*ellipse.T, "--", color=GREY, label="t = 0")
left.plot(fine.real, fine.imag, color="black", label=f"exact, t = {TIME:g}")
colours = {24: ORANGE, 32: GREEN, 48: RED, 64: BLUE}
counts = np.array([24, 32, 48, 64, 96, 128])
errors = np.zeros(len(counts))
for index, cells in enumerate(counts):
    points, errors[index] = computed(cells)
    if cells in colours:
        left.plot(*points.T, ".", color=colours[cells], markersize=4, label=f"grid spacing {2 / cells:.3f}")
left.set(aspect="equal", xlim=(-0.02, 0.56), ylim=(-0.02, 0.62), xlabel="x", ylabel="y", title="a quarter of the curves")
left.legend(loc="upper right")
order = np.polyfit(np.log(2 / counts), np.log(errors), 1)[0]
right.loglog(2 / counts, errors, "o-", color=BLUE, label=f"error: order {order:.2f}")
right.loglog(2 / counts, errors[0] * (counts[0] / counts) ** 2, "--", color=GREY, zorder=0, label="slope 2")
right.set(xlabel="grid spacing (length)", ylabel="distance from the exact curve (length, r.m.s.)", title="error")
right.set_xticks([0.02, 0.04, 0.08], ["0.02", "0.04", "0.08"])
right.xaxis.set_minor_formatter("")
right.legend()
print("order", order, errors)
save(figure, __file__)
