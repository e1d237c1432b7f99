"""Willmore flow of a drawing: the tips of a star become round at once, its arms later."""

import numpy as np
import willmore
from _drawing import BLUE, GREEN, GREY, ORANGE, RED, panels, save
from matplotlib.path import Path

# A star in an image of 240 x 240 pixels, whose rows go from the top to the bottom.
angles = np.arange(10) * np.pi / 5 - np.pi / 2
radii = np.where(np.arange(10) % 2, 42, 100)
corners = 120 + radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
y, x = np.mgrid[:240, :240] + 0.5
star = Path(corners).contains_points(np.column_stack([x.ravel(), y.ravel()])).reshape(240, 240)

flow = willmore.flow(star, cells=80, steps=14)
states = list(flow)
print(flow)

figure, (left, right) = panels([1, 1])
left.imshow(star, cmap="Greys", alpha=0.3, extent=(0, 240, 240, 0))
times, energies = [state.time for state in states], [state.energy for state in states]
right.plot(times, energies, "-", color=GREY)
for step, colour in zip((2, 4, 6, 14), (ORANGE, GREEN, RED, BLUE)):
    state = states[step - 1]
    left.contour(x, y, state.image, [0.5], colors=colour, linewidths=2)
    right.plot(state.time, state.energy, "o", color=colour, markersize=10, label=f"step {step}")
left.set(xlabel="x in pixels", ylabel="y in pixels", title="the star (grey) and its flow")
right.set(xscale="log", yscale="log", xlabel="time in pixels$^4$", ylabel="Willmore energy in 1 / pixels", title="energy")
right.set_yticks([0.05, 0.1, 0.2, 0.4], ["0.05", "0.1", "0.2", "0.4"])
right.yaxis.set_minor_formatter("")
right.legend()
save(figure, __file__)
