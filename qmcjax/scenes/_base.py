"""Scenes: functions on the unit cube with named dimensions. Any object with ``needs`` and a call is one."""

import abc
import inspect
from collections.abc import Callable
from dataclasses import field
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
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree

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


def dimension_names(dims: int) -> tuple[str, ...]:
    """Return the names of all dimensions; those without a meaning are called u2, u3, ..."""
    return ("x", "y", *(f"u{j}" for j in range(2, dims)))[:dims]


_OPTIONAL = ("reference", "reference_gradient", "varies", "boundary", "unrolled", "of_coordinates")
"""Optional attributes of a scene; see `Scene`."""


@frozen_pytree
class PlugIn:
    """An object that is not a pytree as a scene, static by identity."""

    wrapped: Any

    @property
    def needs(self) -> tuple[str, ...]:
        return tuple(unwrap(self.wrapped).needs)

    def __call__(self, point: Array) -> Array:
        return unwrap(self.wrapped)(floats("point", point, (len(self.needs),)))

    def __getattr__(self, name: str) -> Any:
        if name not in _OPTIONAL:
            raise AttributeError(name)
        return getattr(unwrap(self.wrapped), name)

    def __repr__(self) -> str:
        return repr(unwrap(self.wrapped))


@frozen_pytree
class Function:
    """A function of points with named dimensions; see `function`."""

    wrapped: Any
    needs: tuple[str, ...] = field(metadata={"static": True})

    def __call__(self, point: Array) -> Array:
        return unwrap(self.wrapped)(floats("point", point, (len(self.needs),)))

    def __repr__(self) -> str:
        given = unwrap(self.wrapped)
        return f"function({getattr(given, '__name__', checks.shown(given))}, needs={self.needs})"


def as_scene(name: str, value: Any) -> Any:
    """Return an object as a scene: itself if it is a pytree, else wrapped as static by identity.

    Parameters
    ----------
    name : str, name of the argument, for error messages
    value : Scene, any object with ``needs`` that can be called with points

    Raises
    ------
    TypeError
        Also if it has an array as attribute but is not a pytree.

    Examples
    --------
    >>> class Half:
    ...     needs = ("x", "y")
    ...     def __call__(self, point):
    ...         return 0.5 * point[..., 0]
    >>> as_scene("scene", Half()).needs
    ('x', 'y')
    """
    if isinstance(value, ExactScene | PlugIn | Function):
        return value
    needs = getattr(value, "needs", None)
    if isinstance(value, type) or not callable(value) or needs is None:
        raise TypeError(
            f"{name} must be a scene (an object with needs, the names of its dimensions, that is called with "
            f"points), got {checks.shown(value)}"
        )
    _names(f"{name}.needs", needs)
    wrapped = wrap(name, value)
    return value if wrapped is value else PlugIn(wrapped)


def function(f: Callable[[Array], Array], needs: tuple[str, ...]) -> Function:
    """Make a scene from a function.

    Parameters
    ----------
    f : callable
        From points, shape (..., len(needs)), to values, shape (...) or (..., 3), in the points' dtype. The
        same function object compiles once. If it is a pytree, like ``jax.tree_util.Partial``, its arrays are
        parameters: new values do not recompile, and gradients flow to them.
    needs : tuple of str
        The name of each dimension, two or more; the first two are the position on the screen.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> scene = function(lambda point: point[..., 0] * point[..., 2], ("x", "y", "time"))
    >>> scene(jnp.array([0.5, 0.1, 0.5]))
    Array(0.25, dtype=float32)
    """
    checks.function("f", f, "of points")
    return Function(wrap("f", f), _names("needs", needs))


def _names(name: str, needs: Any) -> tuple[str, ...]:
    if not isinstance(needs, tuple | list) or not all(isinstance(each, str) for each in needs):
        raise TypeError(f"{name} must be a tuple of names such as ('x', 'y'), got {checks.shown(needs)}")
    if len(needs) < 2:
        raise ValueError(f"{name} must name the two dimensions of the screen and any others, got {needs!r}")
    return tuple(needs)
