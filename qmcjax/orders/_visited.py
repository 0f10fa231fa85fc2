"""Positions of some pixels, computed once for all their samples."""

from dataclasses import dataclass
from typing import Any

from jax import Array

from qmcjax.core.pytrees import pytree


@pytree
@dataclass(frozen=True)
class Visited:
    """Stands in for an order below a sampler, at the pixels that ``positions`` are of."""

    order: Any
    positions: Array

    @property
    def length(self) -> int:
        """Number of positions on the order's padded curve."""
        return self.order.length

    @property
    def width(self) -> int:
        """Width of the order's image."""
        return self.order.width

    @property
    def height(self) -> int:
        """Height of the order's image."""
        return self.order.height

    def position(self, x: Array, y: Array) -> Array:
        """Return the positions."""
        return self.positions


@pytree
@dataclass(frozen=True)
class VisitedNodes:
    """Stands in for a scrambled Morton order, at the pixels that ``positions`` and ``nodes`` are of."""

    order: Any
    positions: Array
    nodes: Array

    def scrambled(self, code: Array, digits: int) -> tuple[Array, Array]:
        """Return positions and nodes of the pixels."""
        return self.positions, self.nodes

    def scrambled_digits(self, digits: list[Array], node: Array) -> tuple[Array, Array]:
        """Go on below a node."""
        return self.order.scrambled_digits(digits, node)


def visited(order: Any, x: Array, y: Array) -> Visited:
    """Compute the positions of pixels."""
    return Visited(order, order.position(x, y))


def visited_nodes(order: Any, code: Array, digits: int) -> VisitedNodes:
    """Compute the positions and nodes of pixels with these Morton codes."""
    return VisitedNodes(order, *order.scrambled(code, digits))
