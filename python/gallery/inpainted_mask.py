"""A mask with a bite is completed by the curve of least bending energy, and compared with the mask without the bite."""

import numpy as np
import willmore
from _drawing import BLUE, RED, panels, save

# A ring and a bite out of it, as masks of 280 x 280 pixels.
y, x = np.mgrid[:280, :280] + 0.5
radius, from_bite = np.hypot(x - 140, y - 140), np.hypot(x - 222, y - 70)
ring = (radius < 120) & (radius > 60)
bitten = ring & (from_bite > 40)
region = from_bite < 50

result = willmore.inpaint(bitten, region, cells=64, steps=30)
completed = result.image
print(result)

figure, axes = panels([1, 1])
for axis, name, mask in zip(axes, ("bitten", "completed"), (bitten, completed)):
    axis.imshow(mask, cmap="Greys", alpha=0.6, extent=(0, 280, 280, 0), vmax=1.3)
    axis.contour(x, y, region, [0.5], colors=RED, linestyles="dashed")
    axis.contour(x, y, ring, [0.5], colors=BLUE, linewidths=1)
    wrong = np.count_nonzero(mask != ring)
    axis.set(title=f"{name}: {wrong} wrong pixels", xlabel="x in pixels", ylabel="y in pixels")
axes[0].plot([], [], color=RED, linestyle="dashed", label="region to fill")
axes[0].plot([], [], color=BLUE, label="outline of the ring without the bite")
figure.legend(loc="outside lower center", ncols=2)
save(figure, __file__)
