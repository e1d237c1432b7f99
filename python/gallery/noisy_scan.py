"""A scan with noise is faired, and compared with the part that was scanned."""

import matplotlib.pyplot as plt
import numpy as np
import willmore
from _drawing import panels, save, surface

# The part: a lever of 80 mm. Its surface in Willmore flow at time 0 is a mesh.
part = willmore.flow("builtin:lever", cells=64).start.mesh
millimetres = 80 / np.ptp(part.vertices, axis=0).max()
vertices, faces = part.vertices * millimetres, part.faces

# The scan: each vertex has moved along its normal, with a standard deviation of .4 mm.
normals = np.zeros_like(vertices)
sides = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
for corner in range(3):
    np.add.at(normals, faces[:, corner], sides)
normals /= np.linalg.norm(normals, axis=1, keepdims=True)
noise = np.random.default_rng(1).normal(0, 0.4, (len(vertices), 1))
scan = vertices + noise * normals

result = willmore.fair((scan, faces), noise=0.4, cells=64)
print(result)

figure, axes = panels([1, 1])
for axis, name, points in zip(axes, ("scan", "faired"), (scan, result.mesh.vertices)):
    away = willmore.signed_distance((vertices, faces), points)
    of_faces = plt.colormaps["PuOr"](0.5 + away[faces].mean(axis=1) / 1.6)[:, :3]
    surface(axis, [(points, faces)], colours=[of_faces], azimuth=-70, elevation=35, scale=20, unit="mm", smooth=name == "faired")
    axis.set_title(f"{name}: {np.sqrt(np.mean(away**2)):.2f} mm from the part (r.m.s.)")
colours = plt.cm.ScalarMappable(plt.Normalize(-0.8, 0.8), "PuOr")
figure.colorbar(colours, ax=axes, label="distance from the part in mm", shrink=0.8)
save(figure, __file__)
