"""Direction numbers of anybody's Sobol' sequences, in the format of Joe and Kuo's files."""

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from jax.typing import ArrayLike

from qmcjax.core import checks
from qmcjax.sequences._digital import Digital, digital
from qmcjax.sequences._sobol_matrix import DirectionNumbers, checked_numbers, columns_of

_HEAD = "d s a m_i"


def read_direction_numbers(path: str | PathLike[str]) -> tuple[DirectionNumbers, ...]:
    r"""Read direction numbers in the format of Joe and Kuo's files.

    Each line holds d, s, a, and m_1, ..., m_s: the number of the dimension from 2 on, the degree of a
    polynomial, its coefficients without the first and the last one as the binary digits of a, and the
    initial numbers. A first line that does not begin with a digit is a heading.

    Parameters
    ----------
    path : path
        Such as that of ``new-joe-kuo-6.21201`` [1]_.

    Returns
    -------
    tuple of DirectionNumbers
        Those of dimensions 2, 3, ..., for :func:`sobol_of`.

    Raises
    ------
    TypeError
        If ``path`` is neither a path nor a string.
    ValueError
        If a line has another form, another d than the line before and one, a reducible polynomial, or an
        m_k that is even or not below 2**k: names file and line.

    References
    ----------
    .. [1] S. Joe, F. Y. Kuo, "Sobol sequence generator", https://web.maths.unsw.edu.au/~fkuo/sobol.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.NamedTemporaryFile("w") as file:
    ...     _ = file.write("d s a m_i\n2 1 0 1\n3 2 1 1 3\n")
    ...     file.flush()
    ...     print(read_direction_numbers(file.name)[1])
    DirectionNumbers(polynomial=7, initial=(1, 3))
    """
    if not isinstance(path, str | PathLike):
        raise TypeError(f"path must be a path or a string, got {checks.shown(path)}")
    numbers: list[DirectionNumbers] = []
    for count, line in enumerate(Path(path).read_text("ascii", "replace").splitlines(), start=1):
        fields = line.split()
        if not fields or (count == 1 and not fields[0][0].isdigit()):
            continue
        try:
            numbers.append(_parsed(fields, len(numbers) + 2))
        except ValueError as error:
            raise ValueError(
                f"path must be that of a file of direction numbers; line {count} of {path}: {error}"
            ) from None
    if not numbers:
        raise ValueError(f"path must be that of a file of direction numbers; there are none in {path}")
    return tuple(numbers)


def _parsed(fields: Sequence[str], dimension: int) -> DirectionNumbers:
    if len(fields) < 4 or not all(field.isdecimal() for field in fields):
        raise ValueError(f"must be d, s, a, m_1, ..., m_s, got {checks.shown(' '.join(fields))}")
    d, s, a, *initial = map(int, fields)
    if d != dimension:
        raise ValueError(f"d must be {dimension}, got {d}")
    if not 1 <= s <= 32 or a >= 2 ** (s - 1):
        raise ValueError(f"s must be in [1, 32] and a below 2**(s - 1), got s={s}, a={a}")
    return checked_numbers(1 << s | a << 1 | 1, initial)


def direction_numbers_text(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> str:
    """Return the text of a file of direction numbers, as :func:`read_direction_numbers` reads it.

    Parameters
    ----------
    numbers : iterable of DirectionNumbers
        Of dimensions 2, 3, ...: pairs of a polynomial and initial numbers, as for :func:`sobol_matrix`.

    Returns
    -------
    str

    Raises
    ------
    TypeError, ValueError
        If ``numbers`` is no iterable of such pairs.

    Examples
    --------
    >>> print(direction_numbers_text([(0b11, [1]), (0b111, [1, 3])]), end="")
    d s a m_i
    2 1 0 1
    3 2 1 1 3
    """
    rows = [
        (d, len(initial), (polynomial ^ 1 << len(initial)) >> 1, *initial)
        for d, (polynomial, initial) in enumerate(_checked(numbers), start=2)
    ]
    return "\n".join([_HEAD, *(" ".join(map(str, row)) for row in rows), ""])


def sobol_of(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> Digital:
    """Make the Sobol' sequence of given direction numbers.

    Parameters
    ----------
    numbers : iterable of DirectionNumbers
        Of dimensions 2, 3, ...: pairs of a polynomial and initial numbers, as for :func:`sobol_matrix`. The
        first dimension is van der Corput's sequence.

    Returns
    -------
    Digital
        With one dimension more than there are ``numbers``.

    Raises
    ------
    TypeError, ValueError
        If ``numbers`` is no iterable of such pairs.

    Examples
    --------
    >>> print(sobol_of([(0b11, [1]), (0b111, [1, 3])]).points(4))
    [[0.   0.   0.  ]
     [0.5  0.5  0.5 ]
     [0.25 0.75 0.75]
     [0.75 0.25 0.25]]
    """
    identity = np.uint32(1) << np.arange(31, -1, -1, dtype=np.uint32)
    return digital(np.concatenate([identity[None], columns_of(_checked(numbers))]))


def _checked(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> list[DirectionNumbers]:
    wanted = "pairs of a polynomial and initial numbers"
    try:
        pairs = [(polynomial, initial) for polynomial, initial in numbers]
    except (TypeError, ValueError):
        raise TypeError(f"numbers must be {wanted}, got {checks.shown(numbers)}") from None
    if not pairs:
        raise ValueError(f"numbers must be {wanted}, got none")
    checked = []
    for place, (polynomial, initial) in enumerate(pairs):
        try:
            checked.append(checked_numbers(polynomial, initial))
        except (TypeError, ValueError) as error:
            raise type(error)(f"numbers must be {wanted}; number {place}: {error}") from None
    return checked
