"""Smooth surfaces of the organs in a segmentation, with the volumes of their voxels."""

import nibabel
import numpy as np
import willmore
from _drawing import GREEN, ORANGE, RED, SKY, panels, save, surface
from skimage.measure import marching_cubes

# A volume like that of a CT, with voxels of 3 x 3 x 4 mm that are turned a little: two kidneys, an aorta and a spleen.
affine = np.diag([3.0, 3.0, 4.0, 1.0])
c, s = np.cos(0.2), np.sin(0.2)
affine = np.array([[c, -s, 0, -90], [s, c, 0, -60], [0, 0, 1, -70], [0, 0, 0, 1]]) @ affine
i, j, k = np.mgrid[:62, :42, :38]
x, y, z = np.moveaxis(np.stack([i, j, k, np.ones_like(i)], axis=-1) @ affine[:3].T, -1, 0)
labels = np.zeros(x.shape, dtype=np.uint8)
for label, side in ((1, -1), (2, 1)):
    lateral = side * (x - 5) - 45 + 10 * (z / 50) ** 2  # A kidney is bent about its hilum.
    labels[(lateral / 20) ** 2 + ((y - 10) / 19) ** 2 + (z / 50) ** 2 < 1] = label
    labels[(lateral + 20) ** 2 + (y - 10) ** 2 + z**2 < 13**2] = 0
labels[(np.hypot(x - 5 - 4 * np.sin(z / 25), y - 5) < 10) & (abs(z) < 62)] = 3
labels[((x - 62) / 18) ** 2 + ((y - 48 + x / 8) / 14) ** 2 + ((z - 38) / 26) ** 2 < 1] = 4
image = nibabel.Nifti1Image(labels, affine)

organs = willmore.surfaces(image, cells=40)
voxel = abs(np.linalg.det(affine[:3, :3]))
for label, organ in organs.items():
    voxels = voxel * np.count_nonzero(labels == label)
    print(f"label {label}: voxels {voxels / 1000:.2f} ml, surface {organ.to_trimesh().volume / 1000:.2f} ml")

stairs = []
for label in organs:
    blocks = np.kron(np.pad(labels == label, 1), np.ones((3, 3, 3)))  # Corners of voxels show between smaller voxels.
    vertices, faces, *_ = marching_cubes(blocks, 0.5)
    vertices = (vertices - 1) / 3 - 1
    stairs.append((vertices @ affine[:3, :3].T + affine[:3, 3], faces[:, ::-1]))
figure, axes = panels([1, 1])
view = {"colours": [RED, ORANGE, SKY, GREEN], "azimuth": 115, "elevation": 15, "scale": 40, "unit": "mm"}
surface(axes[0], stairs, smooth=False, **view)
surface(axes[1], [organ.mesh for organ in organs.values()], **view)
axes[0].set_title("voxels")
axes[1].set_title("surfaces")
axes[1].set(xlim=axes[0].get_xlim(), ylim=axes[0].get_ylim())
for name, colour in zip(("right kidney", "left kidney", "aorta", "spleen"), view["colours"]):
    axes[0].plot([], [], "s", color=colour, label=name)
figure.legend(loc="outside lower center", ncols=4)
save(figure, __file__)
