"""Scenes: functions on the unit cube with named dimensions."""

import abc
import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike
from numpy.typing import NDArray

from qmcjax.core import checks
from qmcjax.core.parameters import floats, moves_an_edge

EPS = float(np.finfo(float).eps)


class Scene(Protocol):
    """A pure function from a point to a value. Any object with ``needs`` and a call is a scene.

    Dimensions 0 and 1 are the position on the screen, x to the right and y downward: pixel ``(x, y)`` covers
    ``[x, x+1)/width`` times ``[y, y+1)/height`` and is ``image[y, x]``.

    Optional attributes are:

    - ``reference(width, height)``, the mean over each pixel, and a bound on the error of every pixel.
    - ``varies(low, high)``, from opposite corners of boxes of points, shape (..., len(needs)), to a bool
      Array of that shape: False in place j guarantees that within the box the value does not depend on
      coordinate j. If all are False, the value is constant.
    - ``boundary(u)``, the edges where the value jumps; see :func:`qmcjax.boundary_gradient`.
    - ``unrolled``, an int: the maximum number of samples evaluated together in one program. It is 1 for
      scenes with a long program.
    - ``of_coordinates(coordinates)``, the values of shape (n,) or (n, 3) at points whose coordinates are
      separate: a dict of Arrays of shape (n,) by name. Splitting by :func:`qmcjax.render` maps it over some
      of them, and evaluates what depends on the others only once.
    - ``reference_gradient(width, height)``, the exact derivatives of the pixel means with respect to the
      parameters, as :func:`qmcjax.boundary_gradient` returns them but in float64, and a bound on their
      errors.
    """

    @property
    def needs(self) -> tuple[str, ...]:
        """The name of each dimension, in the order of the point's coordinates."""
        ...

    def __call__(self, point: Array, /) -> Array:
        """Evaluate the scene.

        Parameters
        ----------
        point : float Array, shape (..., len(needs)), points in [0, 1)

        Returns
        -------
        float Array, shape (...), of the dtype of ``point``
        """
        ...


def _takes_points(method: Callable[..., Any], names: tuple[str, ...]) -> Callable[..., Any]:
    """Wrap a method of a scene with a check of its points."""
    parameters = inspect.signature(method)

    @wraps(method)
    def checked(*args: Any, **named: Any) -> Any:
        scene, *points = parameters.bind(*args, **named).args
        last = len(scene.needs) - (names == ("u",))
        return method(scene, *(floats(name, p, (last,)) for name, p in zip(names, points, strict=True)))

    return checked


class ExactScene(abc.ABC):
    """A scene with known pixel means; see `Scene` for its attributes."""

    def __init_subclass__(cls) -> None:
        for name, points in {"__call__": ("point",), "varies": ("low", "high"), "boundary": ("u",)}.items():
            if name in vars(cls):
                setattr(cls, name, _takes_points(vars(cls)[name], points))

    def reference(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the exact mean over each pixel.

        Parameters
        ----------
        width, height : int
            The resolution in pixels, each in [1, 65536]. The mean for 1 x 1 pixels is the integral.

        Returns
        -------
        image : float64 ndarray, shape (height, width)
        bound : float
            Bound on the absolute error of every pixel. Rounding dominates: the bound is proportional to the
            resolution, and mostly below 2e-12 at 512 x 512.
        """
        width, height = checks.image_size(width, height)
        return self._pixel_means(width, height)

    @abc.abstractmethod
    def _pixel_means(self, width: int, height: int) -> tuple[NDArray[np.float64], float]:
        """Return the means and the bound."""


def in_float64(scene: Any) -> Any:
    """Return the scene with all parameters as float64 NumPy arrays, for references."""
    return jax.tree.map(lambda leaf: np.asarray(leaf, np.float64), scene)


def cast_edges(scene: Any, dtype: DTypeLike) -> Any:
    """Return the scene with all parameters in ``dtype``, guarded against differentiation.

    A parameter that moves an edge changes the value only on the edge: its plain derivative, 0 almost
    everywhere, is wrong.
    """
    leaves, tree = jax.tree_util.tree_flatten_with_path(scene)
    name = type(scene).__name__
    return tree.unflatten(
        [moves_an_edge(name + jax.tree_util.keystr(path), jnp.asarray(v).astype(dtype)) for path, v in leaves]
    )


def dimension_names(dims: int, names: tuple[str, ...] = ("x", "y")) -> tuple[str, ...]:
    """Return the names of all dimensions; those without a meaning are called u2, u3, ..."""
    return (*names, *(f"u{j}" for j in range(len(names), dims)))[:dims]
