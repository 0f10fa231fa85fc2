"""Direction numbers of Sobol' sequences, in the format of Joe and Kuo's files."""

from collections.abc import Iterable, Sequence
from os import PathLike

import numpy as np
from jax.typing import ArrayLike

from qmcjax.core import checks, tables
from qmcjax.core.tables import IntegerFile, integer_file, wrong
from qmcjax.sequences._digital.digital import Digital, digital
from qmcjax.sequences._digital.sobol_matrix import (
    DirectionNumbers,
    columns_of,
    joe_kuo_numbers,
    validate_numbers,
)

_HEAD = "d s a m_i"
_IDENTITY = np.uint32(1) << np.arange(31, -1, -1, dtype=np.uint32)


def read_direction_numbers(path: str | PathLike[str]) -> tuple[DirectionNumbers, ...]:
    r"""Read direction numbers in the format of Joe and Kuo's files.

    Each line contains d, s, a, and m_1, ..., m_s: the number of the dimension, from 2 on; the degree of a
    polynomial; its coefficients, except the first and the last, as the binary digits of a; and the initial
    numbers. The first line may be ``d s a m_i``. Polynomials must be irreducible, m_k odd and below 2**k.

    Parameters
    ----------
    path : path
        A file such as ``new-joe-kuo-6.21201`` [1]_, or ``soboljk`` and ``sobol`` files of LDData and LatNet
        Builder. ``sobol`` files contain only the initial numbers, for the polynomials of Joe and Kuo.

    Returns
    -------
    tuple of DirectionNumbers
        Of dimensions 2, 3, ..., for :func:`sobol_of`.

    Raises
    ------
    ValueError
        If the file has another format. The message names the file and the line.

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
    path = checks.path(path)
    with tables.named(path):
        return numbers_of(integer_file(path, _HEAD))


def numbers_of(file: IntegerFile) -> tuple[DirectionNumbers, ...]:
    """Return the direction numbers of a file, from the second component on."""
    if file.kind not in ("", "sobol", "soboljk"):
        raise wrong(file.heading.number, "be a heading of direction numbers", file.heading.comment)
    dims = len(file.lines) + 1
    if "dimension" in file.lines[0].comment:  # LatNet Builder states the numbers of components and of points.
        dims = file.header("dimensions")[0].values[0]
        if "points" in file.next("direction numbers").comment:
            file.header("points")
    known = joe_kuo_numbers(slice(len(file.lines))) if file.kind == "sobol" else []
    if len(file.lines) != dims - 1 or (file.kind == "sobol" and len(known) < dims - 1):
        file.next(f"{dims - 1} lines")
        raise wrong(file.lines[-1].number, f"be the last of {dims - 1} lines", f"{len(file.lines)} lines")
    numbers = []
    for place, line in enumerate(file.lines):
        try:
            pair = (known[place].polynomial, line.values) if known else _parsed(line.values, 2 + place)
            numbers.append(validate_numbers(*pair))
        except ValueError as error:
            raise ValueError(f"line {line.number}, {error}") from None
    return tuple(numbers)


def _parsed(values: list[int], dimension: int) -> tuple[int, list[int]]:
    if len(values) < 4:
        raise ValueError(f"must be d, s, a, m_1, ..., m_s, got {checks.shown(' '.join(map(str, values)))}")
    d, s, a, *initial = values
    if d != dimension:
        raise ValueError(f"d must be {dimension}, got {d}")
    if not 1 <= s <= 32 or a >= 2 ** (s - 1):
        raise ValueError(f"s must be in [1, 32] and a below 2**(s - 1), got s={s}, a={a}")
    return 1 << s | a << 1 | 1, initial


def direction_numbers_text(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> str:
    """Return the text of a file of direction numbers, as :func:`read_direction_numbers` reads it.

    Parameters
    ----------
    numbers : iterable of DirectionNumbers
        Of dimensions 2, 3, ...: pairs of a polynomial and initial numbers.

    Examples
    --------
    >>> print(direction_numbers_text([(0b11, [1]), (0b111, [1, 3])]), end="")
    d s a m_i
    2 1 0 1
    3 2 1 1 3
    """
    rows = [
        (d, len(initial), (polynomial ^ 1 << len(initial)) >> 1, *initial)
        for d, (polynomial, initial) in enumerate(_validate_pairs(numbers), start=2)
    ]
    return "\n".join([_HEAD, *(" ".join(map(str, row)) for row in rows), ""])


def sobol_of(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> Digital:
    """Make the Sobol' sequence with the given direction numbers.

    Parameters
    ----------
    numbers : iterable of DirectionNumbers
        Of dimensions 2, 3, ...: pairs of a polynomial and initial numbers, as :class:`DirectionNumbers`. The
        first dimension is the van der Corput sequence. Matrices are invertible and upper triangular.

    Returns
    -------
    Digital, with one dimension more than ``numbers``

    Examples
    --------
    >>> print(sobol_of([(0b11, [1]), (0b111, [1, 3])]).points(4))
    [[0.   0.   0.  ]
     [0.5  0.5  0.5 ]
     [0.25 0.75 0.75]
     [0.75 0.25 0.25]]
    """
    return digital(np.concatenate([_IDENTITY[None], columns_of(_validate_pairs(numbers))]))


def direction_numbers(sequence: Digital) -> tuple[DirectionNumbers, ...]:
    """Find the direction numbers of a Sobol' sequence: the inverse of :func:`sobol_of`.

    Parameters
    ----------
    sequence : Digital
        A Sobol' sequence, as from :func:`sobol`, :func:`one_two` or :func:`sobol_of`, with the van der
        Corput sequence as first component.

    Returns
    -------
    tuple of DirectionNumbers
        Of dimensions 2, 3, ..., for :func:`direction_numbers_text`: those of smallest degree with the same 32
        x 32 matrices.

    Notes
    -----
    The recurrence of Eq. 5.13 [1]_ is linear in the coefficients of the polynomial: elimination finds them,
    degree by degree.

    References
    ----------
    .. [1] L. Gruenschloss, "Motion Blur", 2008.

    Examples
    --------
    >>> from qmcjax.sequences import sobol
    >>> print(direction_numbers(sobol(3)))
    (DirectionNumbers(polynomial=3, initial=(1,)), DirectionNumbers(polynomial=7, initial=(1, 3)))
    """
    if not isinstance(sequence, Digital):
        raise TypeError(f"sequence must be a digital sequence in base 2, got {checks.shown(sequence)}")
    matrices = np.asarray(sequence.matrices)
    if not np.array_equal(matrices[0], _IDENTITY):
        raise ValueError("sequence must begin with the van der Corput sequence, got another component")
    found: list[DirectionNumbers] = []
    for dimension, columns in enumerate(matrices[1:], start=2):
        # In tables, degrees grow with the dimension, so the last one is the best guess.
        guess = len(found[-1].initial) if found else 1
        degrees = [*range(guess, 33), *range(1, guess)]
        tried = (_of_degree(columns.tolist(), degree) for degree in degrees)
        numbers = next((each for each in tried if each is not None), None)
        if numbers is None:
            raise ValueError(
                f"sequence must be a Sobol' sequence, got another matrix in dimension {dimension}"
            )
        found.append(numbers)
    return tuple(found)


def _of_degree(columns: list[int], degree: int) -> DirectionNumbers | None:
    """Return direction numbers of a given degree for a matrix, None if there are none.

    With the columns v_k as fractions, v_k + v_(k-s) + v_(k-s) / 2**s is the sum of a_i v_(k-i), 0 < i < s.
    """
    later = range(degree, 32)

    def joined(words: Iterable[int]) -> int:
        return sum(word << 32 * place for place, word in enumerate(words))

    target = joined(columns[k] ^ columns[k - degree] ^ columns[k - degree] >> degree for k in later)
    basis: list[tuple[int, int]] = []
    for i in range(1, degree):
        vector, chosen = _reduced(joined(columns[k - i] for k in later), 1 << (degree - i), basis)
        if vector:
            basis.append((vector, chosen))
    left, middle = _reduced(target, 0, basis)
    if left:
        return None
    initial = [column >> (31 - k) for k, column in enumerate(columns[:degree])]
    try:
        numbers = validate_numbers(1 << degree | middle | 1, initial)
    except ValueError:
        return None
    return numbers if columns_of([numbers])[0].tolist() == columns else None


def _reduced(vector: int, chosen: int, basis: list[tuple[int, int]]) -> tuple[int, int]:
    """Return a vector reduced by a basis, and the vectors whose sum it is."""
    for other, others in basis:
        if vector >> (other.bit_length() - 1) & 1:
            vector, chosen = vector ^ other, chosen ^ others
    return vector, chosen


def _validate_pairs(numbers: Iterable[tuple[int, Sequence[int] | ArrayLike]]) -> list[DirectionNumbers]:
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
            checked.append(validate_numbers(polynomial, initial))
        except (TypeError, ValueError) as error:
            raise type(error)(f"numbers must be {wanted}; number {place}: {error}") from None
    return checked
