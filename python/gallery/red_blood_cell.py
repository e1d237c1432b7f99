"""A vesicle loses volume and becomes a red blood cell; its shape and its energies lie near the exact equilibria."""

import numpy as np
import willmore
from _drawing import BLUE, GREY, ORANGE, RED, plt, save, surface
from willmore import exact

# A spheroid with the area of a ball of radius .6, as a distance (approximate far from the surface, negative inside).
TARGET, CELLS = 0.75, 64
spacing = 1.9 / CELLS
x, y, z = np.meshgrid(*3 * [(np.arange(CELLS) + 0.5) * spacing - 0.95], indexing="ij")
a, c = 0.74, 0.32
level = np.sqrt((x**2 + y**2) / a**2 + z**2 / c**2)
distance = level * (level - 1) / np.sqrt((x**2 + y**2) / a**4 + z**2 / c**4)

# The area stays. The volume goes to .75 times that of the ball in 5 steps, which are slow enough for the shape to follow.
flow = willmore.flow(
    distance, field_kind="distance", spacing=spacing, origin=spacing / 2 - 0.95, reduced_volume=TARGET, ramp=5, tau=1e-3, steps=6
)
states = list(flow)
last = states[-1]
unit = np.sqrt(last.sizes["area"] / (4 * np.pi))

figure, axes = plt.subplot_mosaic("ac;bc", figsize=(9, 5), dpi=100, width_ratios=[1, 1.1], layout="constrained")
surface(axes["a"], [last.mesh], colours=[RED], elevation=35)
axes["a"].set_title(f"computed vesicle, reduced volume {last.sizes['reduced_volume']:.2f}")

slice_points = willmore.zero_level(last.field[:, CELLS // 2], spacing=spacing, origin=last.origin[0])
profile = exact.vesicle(TARGET).surface.profile
axes["b"].plot(*np.vstack([profile, profile[::-1] * [-1, 1], profile[:1]]).T, color=GREY, label="exact")
axes["b"].plot(*np.concatenate(slice_points)[::3].T / unit, ".", color=RED, label="computed")
axes["b"].set(aspect="equal", xlabel="x in radii of the ball", ylabel="z", title="section")
axes["b"].legend(loc="center")

volumes = np.linspace(0.66, 0.98, 17)
for branch, colour in (("oblate", BLUE), ("prolate", ORANGE)):
    energies = [cell.energy / (8 * np.pi) for cell in exact.vesicle(volumes, branch=branch)]
    axes["c"].plot(volumes, energies, color=colour, label=f"exact, {branch}")
reduced = [state.sizes["reduced_volume"] for state in states]
axes["c"].plot(reduced, [state.energy / (8 * np.pi) for state in states], "o", color=RED, label="computed")
axes["c"].set(xlabel="reduced volume", ylabel="energy / energy of a ball", title="energies")
axes["c"].legend()
print(flow, last, last.energy / exact.vesicle(TARGET).energy - 1)
save(figure, __file__)
