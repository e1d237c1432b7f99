"""Operators are trained for kernels of two widths, and compared with the operator that comes with the package."""

import numpy as np
import willmore
from _drawing import BLUE, GREY, ORANGE, RED, panels, save
from willmore import exact

RADIUS, SPACING = 0.3, 1 / 64
networks = {width: willmore.train_operator(2, width, 2.0, quick=True) for width in (7, 17)}
x, y = np.meshgrid(*2 * [np.arange(-1, 1, SPACING)], indexing="ij")
circle = np.hypot(x, y) - RADIUS


def errors(network):
    """Times, and the errors of the radius of a circle under Willmore flow, relative to the exact radius."""
    flow = willmore.flow(circle, field_kind="distance", spacing=SPACING, origin=-1, time=0.02, tau=5e-4, network=network)
    radii = [(state.time, np.sqrt(state.sizes["area"] / np.pi)) for state in flow]
    return np.array([(time, radius / exact.circle_radius(RADIUS, time) - 1) for time, radius in radii]).T


figure, (left, right) = panels([1, 1])
for (width, network), colour in zip(networks.items(), (ORANGE, BLUE)):
    cells = np.arange(width) - width // 2
    middle = network.kernel[width // 2]
    left.plot(cells, middle, "o-", color=colour, markersize=4, label=f"{width} cells, loss {network.held_out_loss:.0e}")
    time, error = errors(network)
    right.plot(time, 100 * error, color=colour, label=f"{width} cells")
    print(network, network.held_out_loss, error[-1])
time, error = errors(None)
right.plot(time, 100 * error, "--", color=RED, label="the shipped operator")
right.axhline(0, color=GREY, linewidth=1, zorder=0)
left.set(xlabel="distance from the middle in cells", ylabel="kernel", ylim=(-0.004, 0.1), title="kernels along their middle rows")
right.set(xlabel="time (length$^4$)", ylabel="error of the radius in %", title="circle under Willmore flow")
left.legend(loc="upper left")
right.legend()
save(figure, __file__)
