"""Learned operators."""

from __future__ import annotations

import json
import os
import weakref
from functools import cached_property
from typing import Any

import numpy as np

from . import _willmore
from ._options import named
from ._progress import Progress, told
from ._willmore import NetworkData


class Network:
    """A learned step of mean curvature flow ``v[u] = F(K * u)``, as option ``network`` of `flow`, `fair` and `inpaint` takes it.

    Attributes
    ----------
    ratios : dict
        Dimension, width of the kernel in cells, interface width in cells, and time step in squared cells.
    kernel : array of float
        The kernel ``K`` on its cells.
    calibration : dict
        The factors of energy and motion.
    held_out_loss : float or None
        The loss on spheres that the training has not seen; None for a network from a file.
    """

    def __init__(self, data: NetworkData, held_out_loss: float | None = None):
        self._data, self.held_out_loss = data, held_out_loss
        self.ratios: dict[str, Any] = json.loads(data.ratios)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Network:
        """The network in a file (.safetensors).

        Parameters
        ----------
        path
            The file.

        Returns
        -------
        Network

        Raises
        ------
        Error
            A file that holds no network.
        """
        return cls(NetworkData.load(os.fspath(path)))

    @classmethod
    def shipped(cls, name: str) -> Network:
        """A network that comes with the package.

        Parameters
        ----------
        name : str
            Its name in the list of ``willmore networks``, such as ``"d2_k17_eps2_step1"``.

        Returns
        -------
        Network

        Raises
        ------
        Error
            A name that is not in the list.
        """
        return cls(NetworkData.shipped(name))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the network to a file (.safetensors), which the program takes too.

        Parameters
        ----------
        path
            The file. One that is there is written over.

        Raises
        ------
        Error
            A file that cannot be written.
        """
        self._data.save(os.fspath(path))

    @property
    def kernel(self) -> np.ndarray:
        return self._data.kernel.reshape((self.ratios["width"],) * self.ratios["dimension"])

    @property
    def calibration(self) -> dict[str, Any]:
        calibration: dict[str, Any] = json.loads(self._data.calibration)
        return calibration

    @cached_property
    def _path(self) -> str:
        """A file that is there as long as this object."""
        # Not at the beginning: with what they import they take a megabyte, and few need them.
        import shutil
        import tempfile

        folder = tempfile.mkdtemp(prefix="willmore-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        path = os.path.join(folder, "network.safetensors")
        self.save(path)
        return path

    def __fspath__(self) -> str:
        return self._path

    def __repr__(self) -> str:
        return f"<Network for {self.ratios}>"


def train_operator(
    dimension: int,
    width: int,
    eps_over_h: float,
    *,
    step_over_h2: float | None = None,
    quick: bool = False,
    seed: int = 1,
    device: str | None = None,
    progress: Progress = False,
) -> Network:
    """Trains a step of mean curvature flow on shrinking spheres.

    Parameters
    ----------
    dimension : {2, 3}
        The dimension of space.
    width : int
        Width of the kernel in cells, odd.
    eps_over_h : float
        Interface width in cells.
    step_over_h2 : float, optional
        Time step in squared cells, by default ``eps_over_h**2 / 4``, which flows need.
    quick : bool
        Train for seconds, to try it out. Such a network is not accurate. Its `held_out_loss` is that of two spheres, in place of twenty.
    seed : int
        Seed of the random numbers.
    device : str, optional
        ``"flex"``, the processor, unless the package was built with others.
    progress : bool or callable
        Show progress, or call ``progress(title, done, parts)``.

    Returns
    -------
    Network

    Raises
    ------
    Error
        Ratios that no network has.
    """
    options = {
        "dimension": dimension,
        "width": width,
        "eps_over_h": eps_over_h,
        "step_over_h2": step_over_h2,
        "quick": quick,
        "seed": seed,
        "device": device,
    }
    return Network(*_willmore.train(named(options), told(progress)))
