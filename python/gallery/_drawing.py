"""What the pictures of the gallery have in common: colours that colour-blind people tell apart, shaded surfaces, and where pictures go."""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from PIL import Image

BLUE, RED, GREEN, PINK, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
GREY = "#666666"

plt.rcParams.update({"axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False, "font.size": 11})


def panels(widths):
    """A figure of 900 x 500 pixels with panels of these relative widths."""
    figure, axes = plt.subplots(1, len(widths), figsize=(9, 5), dpi=100, width_ratios=widths, layout="constrained")
    return figure, axes


def save(figure, script):
    """Writes the picture to the folder that is the only argument, or to `pictures` beside the script."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(script).parent / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    figure.canvas.draw()
    picture = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy())
    picture.quantize(256, kmeans=1, dither=Image.Dither.NONE).save(folder / f"{Path(script).stem}.png", optimize=True)


def surface(axis, meshes, *, azimuth=-60.0, elevation=30.0, colours=(SKY,), scale=None, unit="", smooth=True):
    """Draws meshes (vertices, faces) from afar, with light from the upper left. A colour is one for
    a mesh, or one for each of its faces. Smooth surfaces have light without edges between faces."""
    a, e = np.radians([azimuth, elevation])
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.cross(forward, right)
    light = 0.55 * forward - 0.45 * right + 0.7 * up
    corners, shades = [], []
    for (vertices, faces), colour in zip(meshes, colours):
        triangles = np.asarray(vertices)[np.asarray(faces)]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
        seen = normals @ forward > 0
        if smooth:
            of_vertices = np.zeros((len(vertices), 3))
            for corner in range(3):
                np.add.at(of_vertices, np.asarray(faces)[:, corner], normals)
            normals = of_vertices[faces].mean(axis=1)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
        lit = np.clip(normals @ (light / np.linalg.norm(light)), 0, 1)
        colour = np.broadcast_to(to_rgb(colour) if isinstance(colour, str) else colour, normals.shape)
        corners.append(triangles[seen])
        shades.append((np.clip(colour * (0.45 + 0.55 * lit[:, None]) + 0.2 * lit[:, None] ** 16, 0, 1))[seen])
    corners, shades = np.concatenate(corners), np.concatenate(shades)
    order = np.argsort((corners @ forward).mean(axis=1))
    flat = (corners @ np.column_stack([right, up]))[order]
    axis.add_collection(PolyCollection(flat, facecolors=shades[order], edgecolors=shades[order], linewidths=0.3))
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axis.axis("off")
    if scale:
        y = low[1] - 0.05 * (high[1] - low[1])
        axis.plot([low[0], low[0] + scale], [y, y], color="black", linewidth=2, clip_on=False)
        axis.text(low[0] + 0.5 * scale, y, f"{scale:g} {unit}\n", ha="center", va="bottom", linespacing=0.4)
        axis.set_ylim(y - 0.03 * (high[1] - low[1]), high[1])
