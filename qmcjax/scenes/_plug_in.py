"""Custom scenes: any object with ``needs`` and a call, or a function."""

from collections.abc import Callable
from dataclasses import field
from typing import Any

from jax import Array

from qmcjax.core import checks
from qmcjax.core.parameters import floats
from qmcjax.core.plug_ins import unwrap, wrap
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.scenes._base import ExactScene

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
