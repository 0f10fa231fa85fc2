"""Files of generator matrices and vectors: each published format, there and back, and errors by line."""

import numpy as np
import pytest

from qmcjax import sequences

EXAMPLES = {
    # Pascal's triangle modulo 2 of four rows and columns, after the identity.
    "dnet": "# dnet\n# by hand\n2    # base\n2    # s\n4   # k\n5   # r\n# columns\n16 8 4 2\n16 24 20 30\n",
    "dnet of 2**4 points": "# dnet \n2 # base\n2 # dimensions\n16 # 2^4 points\n5\n16 8 4 2\n16 24 20 30\n",
    "dnetup": "# dnetup\n2\n2\n4\n4\n1 2 4 8\n1 3 5 15\n",
    "LatNet Builder": "# Parameters for a digital net in base 2\n2 \t# s = 2 dimensions\n"
    "4 \t# n = 2^4 = 16 points\n31 \t# r = 31 digits\n# The columns of gen. matrices, one per line :\n"
    "1073741824 536870912 268435456 134217728\n1073741824 1610612736 1342177280 2013265920\n",
    "Magic Point Shop": "1 2 4 8\n1 3 5 15\n",
    "MatBuilder": "# matrices\n1 0 0 0 \n0 1 0 0 \n0 0 1 0 \n0 0 0 1 \n\n"
    "1 1 1 1 \n0 1 0 1 \n0 0 1 1 \n0 0 0 1 \n\n",
}

LATTICES = {
    "lattice": "# lattice \n# not embedded\n3        # dimensions\n16    # modulus\n# vector:\n1 \n7\n5\n",
    "LatNet Builder": "# Parameters for a lattice rule\n3\t# 3 dimensions\n16\t# n = 16 points\n1\n7\n5\n",
}
VECTORS = {"Magic Point Shop": "1\n7\n5\n", "Kuo": "1 1\n2 7\n3 5\n"}


@pytest.fixture
def file(tmp_path):
    """Return a function that writes a file and returns its path."""

    def write(text):
        (tmp_path / "a.txt").write_text(text, "utf-8")
        return tmp_path / "a.txt"

    return write


@pytest.mark.parametrize("name", EXAMPLES)
def test_formats_of_matrices(name, file):
    """All are the first 16 points of the Sobol' sequence; then points repeat."""
    base = 2 if name == "MatBuilder" else None
    sequence = sequences.digital(sequences.read_matrices(str(file(EXAMPLES[name])), base))
    bits = np.asarray(sequence.bits(np.arange(32, dtype=np.uint32)))
    exact = np.asarray(sequences.sobol(2).bits(np.arange(16, dtype=np.uint32)))
    np.testing.assert_array_equal(bits, np.concatenate([exact, exact]))


def test_digits_of_other_bases(file):
    """MatBuilder's rows, and columns of dnet, whose digits begin with the first row."""
    rows = "1 0 \n0 1 \n\n1 2 \n0 2 \n"
    expected = [[[1, 0], [0, 1]], [[1, 2], [0, 2]]]
    np.testing.assert_array_equal(sequences.read_matrices(file(rows), base=3), expected)
    columns = "# dnet\n3\n2\n2\n2\n3 1\n3 8\n"
    np.testing.assert_array_equal(sequences.read_matrices(file(columns), base=3), expected)


def test_more_rows_than_a_word_are_rounded_down(file):
    """Of 53 rows and 33 columns the first 32 are kept."""
    columns = [2**53 - 1, *(2**52 >> k for k in range(1, 33))]
    text = "# dnet\n2\n1\n33\n53\n" + " ".join(map(str, columns))
    words = sequences.read_matrices(file(text))
    np.testing.assert_array_equal(words[0], [2**32 - 1, *(2**31 >> k for k in range(1, 32))])


@pytest.mark.parametrize("sequence", [sequences.sobol(20), sequences.larcher_pillichshammer()])
def test_matrices_there_and_back(sequence, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(sequences.matrices_text(sequence.matrices))
    found = sequences.read_matrices(path)
    assert found.dtype == np.uint32
    np.testing.assert_array_equal(found, sequence.matrices)
    few = np.asarray(sequence.matrices).copy()
    few[:, 7:] = 0
    path.write_text(sequences.matrices_text(few))
    assert "\n7  # columns\n" in path.read_text()
    np.testing.assert_array_equal(sequences.read_matrices(path), few)


@pytest.mark.parametrize("name", LATTICES)
def test_formats_of_lattices(name, file):
    lattice = sequences.read_lattice(file(LATTICES[name]))
    index = np.arange(16)
    assert lattice.size == 16
    np.testing.assert_array_equal(lattice.points(16), index[:, None] * [1, 7, 5] % 16 / np.float32(16))


@pytest.mark.parametrize("name", VECTORS)
def test_vectors_alone(name, file):
    """With n a lattice, without it the extensible sequence: the same points, by radical inverses."""
    path = file(VECTORS[name])
    lattice, sequence = sequences.read_lattice(path, 16), sequences.read_lattice(path)
    assert sequence.size is None
    order = [int(f"{i:04b}"[::-1], 2) for i in range(16)]
    np.testing.assert_array_equal(np.asarray(sequence.points(16)), np.asarray(lattice.points(16))[order])
    odd = sequences.read_lattice(path, 11)
    np.testing.assert_allclose(odd.points(11), np.arange(11)[:, None] * [1, 7, 5] % 11 / 11, rtol=1e-6)


@pytest.mark.parametrize(
    "lattice",
    [sequences.korobov(1, 2, 0), sequences.korobov(1000, 4, 421), sequences.korobov(2**32, 3, 2**31 + 1)],
)
def test_lattices_there_and_back(lattice, tmp_path):
    (tmp_path / "a.txt").write_text(sequences.lattice_text(lattice))
    assert sequences.read_lattice(tmp_path / "a.txt") == lattice


WRONG = {
    "1 2 x\n": r"a.txt, line 1, column 5, must be non-negative integers, or a comment after #, got '1 2 x'",
    "# d\n1 2\n-1 2\n": r"line 3, column 1, must be non-negative integers",
    "# lattice\n1\n1\n1\n": r"line 1, must be a heading of generator matrices, got 'lattice'",
    "1 0\n0 1\n\n1 0\n0 2\n": r"line 1, may be digits of matrices in any base, or .*: base must .* got '1 0'",
    "# dnet\n3\n1\n1\n1\n1\n": r"line 2, must be the base, base=2, got '3'",
    "# Parameters for a digital net in base 3\n1\n1\n1\n1\n": r"line 1, must be the base, base=2, got '3'",
    "# dnet\n2\n1 2\n": r"line 3, must be one integer of the header: base, .*, got '1 2'",
    "# dnet\n2\n": r"line 2, must be followed by base, dimensions",
    "# dnet\n2\n1\n2\n2\n": r"line 5, must be followed by 1 lines of columns",
    "# dnet\n2\n1\n3\n2\n2 1\n": r"line 6, must be 3 columns, got '2 1'",
    "# dnet\n2\n2\n2\n2\n2 1\n": r"line 6, must be one of 2 lines of columns, got '1 lines'",
    "# dnet\n2\n1\n2\n2\n2 1\n2 1\n": r"line 7, must be one of 1 lines of columns, got '2 lines'",
    "# dnet\n2\n1\n2\n2\n2 4\n": r"line 6, must be integers below 2\*\*2, got '4'",
    "# dnet\n2\n1\n2\n9999999\n2 4\n": r"line 5, must be a number of rows in \[1, 4096\]",
    "1 2 4\n\n1 2\n": r"line 3, must be 3 integers, got '1 2'",
    # An interlaced net without LatNet Builder's comments.
    "# Parameters for a digital net in base 2\n2\n2\n4\n2\n31\n1 2\n": r"line 5, must be 2 columns, got '2'",
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_files_of_matrices_are_named_by_line(text, file):
    with pytest.raises(ValueError, match=WRONG[text]):
        sequences.read_matrices(file(text))


WRONG_LATTICES = {
    "# plattice\n2\n1\n3\n11\n1\n": r"line 1, must be a heading of a rank-1 lattice, got 'plattice'",
    "# Parameters for a polynomial lattice rule in base 2\n1\n3\n11\n1\n": r"line 1, must be a heading",
    "# lattice\n2\n0\n1\n1\n": r"line 3, must be a number of points in \[1, 2\*\*32\], got '0'",
    "# lattice\n2\n5\n1\n": r"line 4, must be the last of 2 integers, got '1 integers'",
    "# lattice\n2\n5\n1\n5\n": r"line 5, must be an integer in \[0, 5\), got '5'",
    "1\n2 7\n": r"line 2, must be one integer, got '2 7'",
    "1 1\n3 7\n": r"line 2, must be dimension 2 and an integer, got '3 7'",
    "1 2 3\n": r"line 1, must be an integer, or a dimension and an integer, got '1 2 3'",
    "4294967296\n": r"line 1, must be an integer in \[0, 4294967296\)",
}


@pytest.mark.parametrize("text", WRONG_LATTICES)
def test_wrong_files_of_lattices_are_named_by_line(text, file):
    with pytest.raises(ValueError, match=WRONG_LATTICES[text]):
        sequences.read_lattice(file(text))


def test_large_files_are_not_read(file):
    path = file(EXAMPLES["dnet"])
    with pytest.raises(ValueError, match=r"a.txt, must take at most max_bytes=10, got \d+ bytes"):
        sequences.read_matrices(path, max_bytes=10)
    with pytest.raises(
        ValueError, match=r"a.txt, line 2, column 1, must be integers of at most 4300 digits, got '9"
    ):
        sequences.read_matrices(file("1 2\n" + "9" * 5000 + " 1\n"))
    with pytest.raises(ValueError, match="line 3, must be the end of a matrix of 2 rows, got '3 rows'"):
        sequences.read_matrices(file("1 0\n0 1\n1 1\n"), base=2)
    with pytest.raises(ValueError, match=r"line 3, must be the number of points, n=8, got '16'"):
        sequences.read_lattice(file("# lattice\n3\n16\n1\n7\n5\n"), 8)
