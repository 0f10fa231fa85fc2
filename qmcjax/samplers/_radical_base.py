"""Which components of a sequence are radical inverses: their first m digits repeat every base**m points."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core.digits import digit_count, digit_spans
from qmcjax.sequences import Digital, Sequence
from qmcjax.sequences._components import BinaryComponents, Components
from qmcjax.sequences._gray import Gray
from qmcjax.sequences._halton import RadicalInverses
from qmcjax.sequences._prime_digital import PrimeDigital
from qmcjax.sequences._rotation import Rotated
from qmcjax.sequences._scrambled import Scrambled
from qmcjax.sequences._scrambled_digits import ScrambledDigits


def radical_bases(sequence: Sequence) -> tuple[int | None, ...]:
    """Return the base of each component that is a radical inverse, scrambled or not, None for any other.

    Of a digital sequence these are the components with lower triangular matrices; while these are being
    traced, all are taken for such.
    """
    if isinstance(sequence, (Components, BinaryComponents)):
        bases = radical_bases(sequence.sequence)
        return tuple(bases[j] for j in sequence.selected)
    if isinstance(sequence, RadicalInverses):
        return sequence.bases
    if isinstance(sequence, (Digital, PrimeDigital)):
        columns = _columns(sequence)
        if columns is None:
            return (_base(sequence),) * sequence.dims
        lower = np.all((columns >= 1) & (columns < _base(sequence)), axis=0)
        return tuple(_base(sequence) if is_lower else None for is_lower in lower)
    # A Gray code mixes the digits of the index.
    if isinstance(sequence, (Scrambled, ScrambledDigits, Rotated)) and not isinstance(sequence, Gray):
        return radical_bases(sequence.sequence)
    return (None,) * sequence.dims


def is_identity(sequence: Digital | PrimeDigital, component: int) -> bool:
    """Tell whether the matrix of a component is the identity, or is being traced."""
    columns = _columns(sequence)
    return columns is None or bool(np.all(columns[:, component] == 1))


@partial(jax.jit, static_argnames=("component", "count"))
def inverse_permutations(sequence: RadicalInverses, component: int, count: int) -> Array:
    """Return the inverses of the permutations of the first digits of an index: uint32 (count, base)."""
    base = sequence.bases[component]
    powers = base ** np.arange(count, dtype=np.uint32)[:, None]
    numbers = sequence.spans(jnp.asarray(powers * np.arange(base, dtype=np.uint32)), np.array(component))
    rows, first = [], 0
    for number, span in zip(numbers, digit_spans(base), strict=True):
        here = range(min(span, count - first))
        rows += [number[first + k] // np.uint32(base**k) % np.uint32(base) for k in here]
        first += span
    return jnp.argsort(jnp.stack(rows), axis=1).astype(jnp.uint32)


def _base(sequence: Digital | PrimeDigital) -> int:
    return 2 if isinstance(sequence, Digital) else sequence.base


def _columns(sequence: Digital | PrimeDigital) -> np.ndarray | None:
    """Return column k of each matrix as a number whose units are row k: float64 (count, dims).

    None if the matrices are being traced.
    """
    base = _base(sequence)
    count = digit_count(base)
    exponent = np.arange(count, dtype=np.uint32)
    with jax.enable_x64(True):
        points = _points(sequence, jnp.asarray(np.uint32(base) ** exponent))
    if isinstance(points, Tracer):
        return None
    # As multiples of the smallest digit they are integers below 2**53, but for the rounding of a division.
    return np.round(np.asarray(points) * float(base) ** count) / float(base) ** (
        count - 1.0 - exponent[:, None]
    )


@jax.jit
def _points(sequence: Sequence, index: Array) -> Array:
    return sequence._values(index, tuple(range(sequence.dims)), jnp.float64)
