"""Extract Joe and Kuo's table from scipy's Sobol' engine, through its public interface, and pack it.

Run once (half a minute): ``python -m analysis.tables.make_joe_kuo``.

In Gray code order, point 2**(k+1) - 1 is column k alone. Degree s means that the first s columns
are free and column s follows from Eq. 5.13 of the thesis. In the latter the polynomial's
coefficients form a triangular system, as every m_k is odd.
"""

from pathlib import Path

import numpy as np
from scipy.stats import qmc

from analysis.tables import SEQUENCES

DIMS = 21201
DEGREES = 18


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


def main(folder: Path = SEQUENCES) -> None:
    """Write joe_kuo.npz into a folder."""
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
    np.savez_compressed(folder / "joe_kuo.npz", polynomials=polynomials, initial=initial)


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


if __name__ == "__main__":
    main()
