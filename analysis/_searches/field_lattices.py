"""Lattices of totally real number fields, clipped to the unit square or cube: initial ranks for a search.

The conjugates of the integers of such a field form a lattice. The product of a point's coordinates is the
norm of an integer and stays away from 0: sections of the lattice have discrepancies of the smallest known
order. Stretching the axes by factors of product 1, translating the lattice and choosing its density gives a
family with a few parameters and thousands of different ranks. The fields are those of smallest discriminant:
Q(sqrt 5) in the plane, Q(cos 2 pi/7) in space.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis._loops import compiled

Floats = NDArray[np.float64]

_GOLDEN = (1 + np.sqrt(np.array([5.0, 5.0])) * [1, -1]) / 2
_HEPTAGON = 2 * np.cos(2 * np.pi * np.arange(1, 4) / 7)
_BASES = {2: np.vander(_GOLDEN, 2, increasing=True), 3: np.vander(_HEPTAGON, 3, increasing=True)}
"""Conjugates, one per row, of 1, w, ... The determinants are the roots of the discriminants, 5 and 49."""


class FieldLattice(NamedTuple):
    """The position of a lattice."""

    stretch: Floats
    """Logarithms of factors along the axes, their sum 0."""
    offset: Floats
    """In units of the basis."""
    density: float
    """Mean number of points in the unit square or cube."""


def random_lattice(n: int, dims: int, rng: np.random.Generator) -> FieldLattice:
    """Draw a lattice; units of the field make all larger stretches equivalent to one of these."""
    stretch = rng.uniform(-1, 1, dims)
    return FieldLattice(stretch - stretch.mean(), rng.random(dims), n + rng.uniform(-1, 1))


def nearby(lattice: FieldLattice, rng: np.random.Generator) -> FieldLattice:
    """Change a lattice slightly."""
    scale = 10 ** rng.uniform(-4, -1)
    stretch = lattice.stretch + scale * rng.standard_normal(len(lattice.stretch))
    offset = lattice.offset + scale * rng.standard_normal(len(lattice.offset))
    return FieldLattice(stretch - stretch.mean(), offset, lattice.density + scale * rng.standard_normal())


def section(lattice: FieldLattice) -> Floats:
    """Return the points of a lattice in [0, 1)^dims, in the order of the first coordinate."""
    stretch, offset, density = lattice
    dims = len(stretch)
    basis = _BASES[dims]
    scaled = basis * np.exp(stretch)[:, None] * (density * abs(np.linalg.det(basis))) ** (-1 / dims)
    # The corners of the cube, in units of the basis.
    corners = np.indices((2,) * dims).reshape(dims, -1).T @ np.linalg.inv(scaled).T - offset
    low, high = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    points = _inside(scaled, offset, low, (high - low).astype(np.int64) + 1)
    return points[np.argsort(points[:, 0], kind="stable")]


@compiled
def _inside(scaled: Floats, offset: Floats, low: Floats, sizes: NDArray[np.int64]) -> Floats:
    """Return the lattice points in the unit cube; ``low`` and ``sizes`` bound the coefficients."""
    dims = len(offset)
    found = np.empty((np.prod(sizes) + 1, dims))
    count = 0
    for index in range(len(found) - 1):
        rest, inside = index, True
        point = found[count]
        point[:] = 0.0
        for b in range(dims):
            step = low[b] + rest % sizes[b] + offset[b]
            rest //= sizes[b]
            for a in range(dims):
                point[a] += scaled[a, b] * step
        for a in range(dims):
            inside = inside and 0 <= point[a] < 1
        if inside:
            count += 1
    return found[:count].copy()
