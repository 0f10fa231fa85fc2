"""Joe and Kuo's components of Sobol's sequence, and those that make a cascaded net of small t.

**Joe and Kuo's table** is extracted from scipy's Sobol' engine, through its public interface. In Gray code
order, point 2**(k+1) - 1 is column k alone. Degree s means that the first s columns are free and column s
follows from Eq. 5.13 of the thesis. In the latter the polynomial's coefficients form a triangular system, as
every m_k is odd.

**The components of the cascaded net** are chosen greedily, dimension by dimension:
``python -m analysis.tables.sobol_components`` prints the tuple of ``cascaded_net`` (minutes). The
cost is the sum over m of the square of t of all pairs with a previous dimension, and of the last three and
four dimensions together. Adjacent pairs have t = 0 for any component. No pair is left out: a component that
is repeated eventually makes the same dimensions again.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from analysis import t_value
from qmcjax.sequences import sobol

DIMS = 21201
DEGREES = 18

CASCADED = 32
COMPONENTS = 60
SIZES = range(4, 15)


def columns(count: int) -> np.ndarray:
    """Return the numbers m_1 .. m_count of all components, shape (DIMS, count)."""
    engine = qmc.Sobol(DIMS, scramble=False, bits=32)
    numbers, position = [], 0
    for k in range(count):
        engine.fast_forward(2 ** (k + 1) - 1 - position)
        fraction = engine.random(1)[0]
        position = 2 ** (k + 1)
        numbers.append((fraction * 2.0 ** (k + 1)).astype(np.uint64))
    return np.stack(numbers, axis=1)


def joe_kuo() -> Iterator[dict[str, NDArray]]:
    """Yield the polynomials and initial direction numbers."""
    numbers = columns(DEGREES + 1)
    polynomials = np.zeros(DIMS - 1, np.uint32)
    initial = np.zeros((DIMS - 1, DEGREES), np.uint32)
    component, degree = 1, 1
    while component < DIMS:
        # Joe and Kuo take the primitive polynomials in the order of their degrees.
        for _ in range(primitive_count(degree)):
            if component == DIMS:
                break
            m = [int(v) for v in numbers[component]]
            rest = m[degree] ^ m[0] ^ (m[0] << degree)
            polynomial = (1 << degree) | 1
            for i in range(1, degree):
                if rest >> i & 1:
                    rest ^= m[degree - i] << i
                    polynomial |= 1 << (degree - i)
            if rest:
                raise ArithmeticError(f"component {component} does not have degree {degree}")
            polynomials[component - 1] = polynomial
            initial[component - 1, :degree] = m[:degree]
            component += 1
        degree += 1
    yield {"polynomials": polynomials, "initial": initial}


def primitive_count(degree: int) -> int:
    """Return the number of primitive polynomials over F2, phi(2**degree - 1) / degree."""
    order = totient = 2**degree - 1
    factor = 2
    while factor <= order:
        if order % factor == 0:
            totient -= totient // factor
            while order % factor == 0:
                order //= factor
        factor += 1
    return max(totient // degree, 1)


def following(columns: NDArray[np.uint32], m: int, matrix: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the columns of a dimension from those of the previous one: its points are the indices."""
    digits = columns[:, None] >> np.uint32(32 - m) >> np.arange(m, dtype=np.uint32) & np.uint32(1)
    return np.bitwise_xor.reduce(digits * matrix[:m], axis=1)


def cost(nets: dict[int, list[NDArray[np.uint32]]], most: float) -> float:
    """Return the cost of the last dimension, or a partial cost that reached ``most``."""
    last = len(nets[SIZES[0]]) - 1
    sets = [(j, last) for j in range(last - 2, -1, -1)]
    sets += [tuple(range(last - k, last + 1)) for k in (2, 3) if last >= k]
    total = 0
    for dims in sets:
        total += sum(t_value(_words([net[j] for j in dims]), m=m) ** 2 for m, net in nets.items())
        if total >= most:
            break
    return total


def _words(columns: list[NDArray[np.uint32]]) -> NDArray[np.uint32]:
    """Return columns as :func:`analysis.t_value` takes them, 32 of each dimension."""
    return np.pad(np.stack(columns), ((0, 0), (0, 32 - len(columns[0]))))


def cascade() -> tuple[int, ...]:
    """Return the components."""
    matrices = np.asarray(sobol(COMPONENTS + 1).matrices)
    nets = {m: [np.uint32(1) << np.arange(32 - m, 32, dtype=np.uint32)] for m in SIZES}
    chosen: list[int] = []
    while len(chosen) < CASCADED - 1:
        least, best = np.inf, (0, nets)
        for component in range(1, COMPONENTS + 1):
            tried = {m: [*net, following(net[-1], m, matrices[component])] for m, net in nets.items()}
            found = cost(tried, least)
            if found < least:
                least, best = found, (component, tried)
        component, nets = best
        chosen.append(component)
    return tuple(chosen)


if __name__ == "__main__":
    print(cascade())
