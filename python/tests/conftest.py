"""Shapes that many tests take."""

import numpy as np
import pytest
import trimesh


def icosphere(subdivisions):
    """A sphere of radius 1, of triangles of about one size."""
    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def volume(vertices, faces):
    """The volume inside of a closed mesh."""
    a, b, c = (np.asarray(vertices, dtype=float) - np.mean(vertices, axis=0, dtype=float))[faces].transpose(1, 0, 2)
    return np.einsum("ij,ij", a, np.cross(b, c)) / 6


def centroid(vertices, faces):
    """The centroid of the inside of a closed mesh."""
    middle = vertices.mean(axis=0)
    a, b, c = (vertices - middle)[faces].transpose(1, 0, 2)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
    return middle + ((a + b + c) / 4 * volumes[:, None]).sum(axis=0) / volumes.sum()


def roughness(vertices):
    """The standard deviation of the distances from the origin: 0 for a sphere."""
    return np.linalg.norm(vertices, axis=1).std()


@pytest.fixture(scope="session")
def sphere():
    return icosphere(2)


@pytest.fixture(scope="session")
def noisy(sphere):
    """A sphere with noise of 0.02 along its normals."""
    vertices, faces = sphere
    noise = np.random.default_rng(1).normal(0, 0.02, (len(vertices), 1))
    return vertices * (1 + noise), faces


@pytest.fixture(scope="session")
def ball():
    """Voxels in a ball, which touches no side of the array."""
    x, y, z = np.mgrid[:12, :13, :14]
    return (x - 5.2) ** 2 + (y - 6.1) ** 2 + (z - 6.7) ** 2 < 14.5


@pytest.fixture(scope="session")
def square():
    """Pixels in a rectangle."""
    x, y = np.mgrid[:48, :40]
    return (abs(x - 20) < 10) & (abs(y - 22) < 7)


def circle_field(cells=48, spacing=0.1, origin=(5.0, 7.0), radius=1.2):
    """The phase field of a circle in the middle, and the positions of its nodes."""
    nodes = np.mgrid[:cells, :cells] * spacing + np.reshape(origin, (2, 1, 1))
    middle = np.reshape(origin, (2, 1, 1)) + cells * spacing / 2
    distance = np.linalg.norm(nodes - middle, axis=0) - radius
    return np.tanh(-distance / (np.sqrt(2) * 2 * spacing)), nodes
