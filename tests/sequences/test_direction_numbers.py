"""Direction numbers in Joe and Kuo's format: there and back, and errors that name the line."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from tables import slow

from qmcjax import sequences
from qmcjax.sequences._digital.sobol_matrix import _is_irreducible

FILE = Path(__file__).parents[1] / "direction_numbers.txt"


def joe_kuo(dims: int) -> list[tuple[int, list[int]]]:
    """Return pairs for the dimensions from 2 on, off the packed table."""
    source = resources.files("qmcjax.sequences") / "_data" / "joe_kuo.npz"
    with source.open("rb") as stream, np.load(stream) as table:
        rows = zip(table["polynomials"][: dims - 1].tolist(), table["initial"].tolist(), strict=False)
        return [(polynomial, initial[: polynomial.bit_length() - 1]) for polynomial, initial in rows]


def test_a_file_that_is_known():
    """Typed in: dimension 5 is x**3 + x**2 + 1, a = 10 in binary digits."""
    numbers = sequences.read_direction_numbers(FILE)
    assert numbers == ((0b11, (1,)), (0b111, (1, 3)), (0b1011, (1, 3, 1)), (0b1101, (1, 1, 1)))
    assert numbers[2].polynomial == 0b1011
    assert numbers[2].initial == (1, 3, 1)
    assert np.array_equal(sequences.sobol_of(numbers).matrices, sequences.sobol(5).matrices)


@pytest.mark.parametrize("dims", [600, *slow(21201)])
def test_there_and_back(dims, tmp_path):
    """The table of Joe and Kuo through a file is the sequence that is built in."""
    (tmp_path / "a.txt").write_text(sequences.direction_numbers_text(joe_kuo(dims)))
    numbers = sequences.read_direction_numbers(str(tmp_path / "a.txt"))
    assert np.array_equal(sequences.sobol_of(numbers).matrices, sequences.sobol(dims).matrices)
    assert sequences.direction_numbers_text(numbers) == (tmp_path / "a.txt").read_text()


@pytest.mark.parametrize(
    "sequence", [sequences.sobol(200), sequences.one_two(20), sequences.sobol_of([(0b11111, [1, 3, 5, 7])])]
)
def test_numbers_are_found_in_matrices(sequence):
    """They make the same matrices; of Joe and Kuo's they are those of the table."""
    numbers = sequences.direction_numbers(sequence)
    assert np.array_equal(sequences.sobol_of(numbers).matrices, sequence.matrices)
    if sequence.dims == 200:
        assert [(p, list(initial)) for p, initial in numbers] == joe_kuo(200)


def test_other_matrices_have_no_numbers():
    random = np.random.default_rng(1).integers(0, 2**32, 32, np.uint32)
    upper = np.array([(column | 1) << (31 - k) & 2**32 - 1 for k, column in enumerate(random.tolist())])
    matrices = np.stack([sequences.sobol(1).matrices[0], upper.astype(np.uint32)])
    with pytest.raises(ValueError, match="got another matrix in dimension 2"):
        sequences.direction_numbers(sequences.digital(matrices))
    with pytest.raises(ValueError, match="sequence must begin with the van der Corput sequence"):
        sequences.direction_numbers(sequences.digital(matrices[::-1]))


def test_heading_and_empty_lines_may_be_missing_or_there(tmp_path):
    (tmp_path / "a.txt").write_text("2 1 0 1\n\n3\t2 1   1 3\n")
    assert sequences.read_direction_numbers(tmp_path / "a.txt") == ((0b11, (1,)), (0b111, (1, 3)))


def test_irreducible_polynomials_that_are_not_primitive_do():
    """x**4 + x**3 + x**2 + x + 1: each coordinate alone is still a (0,1)-sequence."""
    words = np.asarray(sequences.sobol_of([(0b11111, [1, 3, 5, 7])]).matrices)[1]
    assert np.array_equal(words & -words.astype(np.int64), 1 << np.arange(31, -1, -1))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["d s a m_i", "2 1 0 1", "3 2 1 1"], r"a.txt, line 3, initial must be 2 integers"),
        (["2 1 0 1", "", "3 2 1 1 2"], r"a.txt, line 3, initial must be odd .* m_2=2"),
        (["2 1 0 1", "4 2 1 1 3"], "a.txt, line 2, d must be 3, got 4"),
        (["d s a m_i", "3 1 0 1"], "a.txt, line 2, d must be 2, got 3"),
        (["2. 1 0 1"], "line 1, column 1, must be non-negative integers"),
        (["2 2 0 1 3"], "a.txt, line 1, polynomial must be irreducible .* got 0b101"),
        (["2 1 1 1"], "a.txt, line 1, s must be in .* got s=1, a=1"),
        (["2 33 1 1"], "a.txt, line 1, s must be in .* got s=33, a=1"),
        (["2 1 0"], "a.txt, line 1, must be d, s, a, m_1, ..., m_s, got '2 1 0'"),
    ],
)
def test_errors_name_the_line(lines, message, tmp_path):
    (tmp_path / "a.txt").write_text("\n".join(lines))
    with pytest.raises(ValueError, match=message):
        sequences.read_direction_numbers(tmp_path / "a.txt")


def test_what_is_no_text(tmp_path):
    (tmp_path / "a.txt").write_bytes(bytes(range(256)))
    with pytest.raises(ValueError, match=r"a.txt, line 1, column 1, must be non-negative integers"):
        sequences.read_direction_numbers(tmp_path / "a.txt")


def test_sobol_matrix_equals_the_sequence():
    """From Joe and Kuo's polynomials and initial numbers; the first component has none."""
    dims = 1200
    matrices, numbers = np.asarray(sequences.sobol(dims).matrices), joe_kuo(dims)
    for j in [*range(1, 60), *range(60, dims, 97)]:
        assert np.array_equal(sequences.sobol_matrix(*numbers[j - 1]), matrices[j])


def test_sobol_matrix_of_the_largest_degree_is_its_initial_numbers():
    initial = [2**k - 1 for k in range(1, 33)]
    matrix = sequences.sobol_matrix(2**32 + 2**22 + 2**2 + 2 + 1, initial)
    assert np.asarray(matrix).tolist() == [m << (32 - k) for k, m in enumerate(initial, start=1)]


def test_irreducible_polynomials_are_counted():
    """By Moebius' inversion, those of degree s: sum over d | s of mu(d) 2**(s / d), over s; without x."""
    counts = [sum(map(_is_irreducible, range(2**s, 2 ** (s + 1)))) for s in range(1, 11)]
    assert counts == [1, 1, 2, 3, 6, 9, 18, 30, 56, 99]
