"""Direction numbers in Joe and Kuo's format, there and back."""

from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from tables import slow

from qmcjax import sequences
from qmcjax.core.number_theory import is_irreducible

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


OF_ONE = sequences.sobol_of([(0b11111, [1, 3, 5, 7])])


@pytest.mark.parametrize("sequence", [sequences.sobol(200), sequences.one_two(20), OF_ONE])
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
    words = np.asarray(OF_ONE.matrices)[1]
    assert np.array_equal(words & -words.astype(np.int64), 1 << np.arange(31, -1, -1))


def test_sobol_matrix_of_the_largest_degree_is_its_initial_numbers():
    initial = [2**k - 1 for k in range(1, 33)]
    _, matrix = sequences.sobol_of([(2**32 + 2**22 + 2**2 + 2 + 1, initial)]).matrices
    assert np.asarray(matrix).tolist() == [m << (32 - k) for k, m in enumerate(initial, start=1)]


def test_irreducible_polynomials_are_counted():
    """By Moebius' inversion, those of degree s: sum over d | s of mu(d) 2**(s / d), over s; without x."""
    counts = [sum(map(is_irreducible, range(2**s, 2 ** (s + 1)))) for s in range(1, 11)]
    assert counts == [1, 1, 2, 3, 6, 9, 18, 30, 56, 99]


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

COMMAND = "# Input Command Line: -t net -c sobol -s 2^16 -d 4 -o folder\n# Merit: 5\n"
HEADINGS = ("# lattice \n# not embedded\n", "# Parameters for a lattice rule\n")
HEADINGS += (f"{COMMAND}\n# Parameters for a lattice rule, embedded from 2 to 16\n",)
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
def test_matrices_there_and_back(sequence, file):
    found = sequences.read_matrices(file(sequences.matrices_text(sequence.matrices)))
    assert found.dtype == np.uint32 and np.array_equal(found, sequence.matrices)
    few = np.asarray(sequence.matrices).copy()
    few[:, 7:] = 0
    text = sequences.matrices_text(few)
    assert "\n7  # columns\n" in text and np.array_equal(sequences.read_matrices(file(text)), few)


@pytest.mark.parametrize("heading", HEADINGS)
def test_formats_of_lattices(heading, file):
    text = f"{heading}3    # dimensions\n16    # modulus = n = 16 points\n# vector:\n1 \n7\n5"
    lattice = sequences.read_lattice(file(text))
    assert lattice.size == 16
    assert np.array_equal(lattice.points(16), np.arange(16)[:, None] * [1, 7, 5] % 16 / np.float32(16))


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


@pytest.mark.parametrize("numbers", [(1, 2, 0), (1000, 4, 421), (2**32, 3, 2**31 + 1)], ids=str)
def test_lattices_there_and_back(numbers, file):
    lattice = sequences.korobov(*numbers)
    assert sequences.read_lattice(file(sequences.lattice_text(lattice))) == lattice


POLYNOMIAL = (
    f"{COMMAND}# Parameters for a polynomial lattice rule in base 2\n3       # 3 dimensions\n"
    "10      # k = 10, n = 2^10 = 1024 points\n1033   # polynomial modulus\n"
    "# Coordinates of generating vector, starting at j=1\n1\n800\n839"
)
POLYNOMIAL_NET = (
    f"{COMMAND}# Parameters for a digital net in base 2\n3    # 3 dimensions\n"
    "10   # k = 10,  n = 2^10 = 1024 points\n31   # r = 31 binary output digits\n"
    "# Columns of gen. matrices C_1,...,C_s, one matrix per line\n"
    "2097152 4194304 8388608 16777216 33554432 67108864 134217728 270532608 541065216 1082130432\n"
    "1690304512 1235222528 322961408 645922816 1291845632 436207616 "
    "874512384 1749024768 1350565888 555745280\n"
    "1746927616 1346371584 547356672 1094713344 44040192 88080384 176160768 354418688 708837376 1419771904"
)
SOBOL = (
    f"{COMMAND}# Parameters m_{{j,c}} for Sobol points\n4    # 4 dimensions\n"
    "# m_{j,c}, starting from the second coordinate\n1\n1 1\n1 3 1"
)
SOBOL_JK = (
    f"{COMMAND}# Parameters for Sobol points, in JK format\n4    # 4 dimensions\n"
    "#  d  a  m_{j,c}\n2  1  0  1\n3  2  1  1 1\n4  3  1  1 3 1"
)
SOBOL_NET = (
    f"{COMMAND}# Parameters for a digital net in base 2\n4    # s = 4 dimensions\n"
    "6   # k = 6,  n = 2^6 = 64 points\n31    # r = 31 binary output digits\n"
    "# Columns of gen. matrices C_1,...,C_s, one matrix per line\n"
    "1073741824 536870912 268435456 134217728 67108864 33554432\n"
    "1073741824 1610612736 1342177280 2013265920 1140850688 1711276032\n"
    "1073741824 536870912 1879048192 1476395008 872415232 2046820352\n"
    "1073741824 1610612736 268435456 671088640 2080374784 973078528"
)
POINTS = "16    # k = 16,  n = 2^16 = 65536 points\n"


def net_points(text, rows=31):
    """Return points of matrices in net style as fractions of 32 bits: columns added for the digits of i."""
    table = text.rpartition("one matrix per line\n")[2]
    columns = np.array([line.split() for line in table.splitlines()]).astype(np.int64)
    index, k = np.arange(2 ** columns.shape[1])[:, None, None], np.arange(columns.shape[1])
    return np.bitwise_xor.reduce(columns * (index >> k & 1), axis=-1) << (32 - rows)


def bits(text_file, n):
    sequence = sequences.digital(sequences.read_matrices(text_file))
    return np.asarray(sequence.bits(np.arange(n, dtype=np.uint32)))


def product(a, b):
    """Multiply polynomials over F2."""
    return 0 if not b else (a if b & 1 else 0) ^ product(a << 1, b >> 1)


def quotient(a, b):
    """Divide polynomials over F2, without remainder."""
    found = 0
    while (beyond := a.bit_length() - b.bit_length()) >= 0:
        found, a = found | 1 << beyond, a ^ b << beyond
    return found


@pytest.mark.parametrize("style", ["LatNet Builder", "LDData"])
def test_polynomial_lattices(style, file):
    """Points are the leading digits of h q / p; this net style has the first ten of them."""
    plain = "# plattice\n2 # base\n3\n10\n1033\n# coordinates\n1\n800\n839\n"
    found = bits(file(POLYNOMIAL if style == "LatNet Builder" else plain), 1024)
    expected = [[quotient(product(h, q) << 32, 1033) & 2**32 - 1 for q in (1, 800, 839)] for h in range(1024)]
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(found >> 22 << 22, net_points(POLYNOMIAL_NET))
    np.testing.assert_array_equal(bits(file(POLYNOMIAL_NET), 1024), net_points(POLYNOMIAL_NET))


def test_sobol_points(file):
    """Both formats, of old and new versions and of LDData, are the net that the program makes of them."""
    exact = net_points(SOBOL_NET)
    numbers = ((0b11, (1,)), (0b111, (1, 1)), (0b1011, (1, 3, 1)))
    new = SOBOL_JK.replace("#  d", f"{POINTS}#  d").replace("4    # 4", "4    # s = 4")
    newer = SOBOL.replace("Parameters", "Initial direction numbers").replace("# m_", f"{POINTS}# m_")
    short = "# sobol\n# 4 dimensions\n1   # This is  m_{j,c} for the second coordinate\n1 1\n1 3 1\n"
    short_jk = "# soboljk\n# 4 dimensions\n2 1 0 1\n3 2 1 1 1\n4 3 1 1 3 1\n"
    for text in (SOBOL, newer, SOBOL_JK, new, short, short_jk):
        np.testing.assert_array_equal(bits(file(text), 64), exact)
        assert sequences.read_direction_numbers(file(text)) == numbers
    np.testing.assert_array_equal(bits(file(SOBOL_NET), 64), exact)


REFUSED = {
    "read_lattice": {
        "# plattice\n2\n1\n3\n11\n1\n": "line 1, must be a heading of a rank-1 lattice, got 'plattice'",
        POLYNOMIAL: "line 3, must be a heading of a rank-1 lattice, got 'parameters for a polynomial lattice",
        f"{COMMAND}5\n3\n": "line 1, must be a heading of a rank-1 lattice, got 'input command line",
        "# lattice\n2\n0\n1\n1\n": r"line 3, must be a number of points in \[1, 2\*\*32\], got '0'",
        "# lattice\n2\n5\n1\n": r"line 4, must be the last of 2 lines, got '1 lines'",
        "# lattice\n2\n5\n1\n5\n": r"line 5, must be an integer in \[0, 5\), got '5'",
        "1\n2 7\n": r"line 2, must be one integer, got '2 7'",
        "1 1\n3 7\n": r"line 2, must be dimension 2 and an integer, got '3 7'",
        "1 2 3\n": r"line 1, must be dimension 1 and an integer, got '1 2 3'",
        "4294967296\n": r"line 1, must be an integer in \[0, 4294967296\)",
    },
    "read_matrices": {
        "1 2 x\n": r"a.txt, line 1, column 5, must be non-negative integers, or a comment after #, got 'x'",
        "# d\n1 2\n-1 2\n": r"line 3, column 1, must be non-negative integers",
        "# lattice\n1\n1\n1\n": r"line 1, must be a heading of generator matrices, got 'lattice'",
        "1 0\n0 1\n\n1 0\n0 1\n": r"line 1, must be columns .*: base must be given for rows of .* got '1 0'",
        "# dnet\n3\n1\n1\n1\n1\n": r"line 2, must be the base, base=2, got '3'",
        "# Parameters for a digital net in base 3\n1\n1\n1\n1\n": r"line 1, must be the base, .* got '3'",
        "# dnet\n2\n1 2\n": r"line 3, must be one integer of the header: dimensions, .*, got '1 2'",
        "# dnet\n2\n": r"must contain dimensions, columns, rows, got the end of the file",
        "# dnet\n2\n1\n2\n2\n": r"must contain lines of columns, got the end of the file",
        "# dnet\n2\n1\n3\n2\n2 1\n": r"line 6, must be 3 columns, got '2 1'",
        "# dnet\n2\n2\n2\n2\n2 1\n": r"line 6, must be the last of 2 lines, got '1 lines'",
        "# dnet\n2\n1\n2\n2\n2 4\n": r"line 6, must be integers below 2\*\*2, got '4'",
        "# dnet\n2\n1\n2\n9999999\n2 4\n": r"line 5, must be a number of rows in \[1, 4096\]",
        "1 2 4\n\n1 2\n": r"line 3, must be 3 integers, got '1 2'",
        "1 2\n" + "9" * 5000 + " 1\n": "line 2, column 1, must be non-negative integers, .* got '9999",
        "# plattice\n2\n1\n1\n3\n": "must contain 1 lines, got the end of the file",
        POLYNOMIAL.replace("1033", "1999999"): "line 6, must be a polynomial of degree 10, got '1999999'",
        POLYNOMIAL.replace("839", "1039"): "line 10, must be a polynomial of degree below 10, got '1039'",
        POLYNOMIAL.replace("10      #", "40      #"): r"line 5, must be a degree in \[1, 32\], got '40'",
        SOBOL_NET.replace("6   # k", "2   # Interlacing factor\n6   # k"): "line 5, must be no interlacing",
        SOBOL.replace("4    #", "5    #"): "line 8, must be the last of 4 lines, got '3 lines'",
        SOBOL.replace("1 1\n", "1 1 1\n"): "line 7, initial must be 2 integers",
    },
    "read_direction_numbers": {
        POLYNOMIAL_NET: "line 3, must be a heading of direction numbers, got 'para",
        "d s a m_i\n2 1 0 1\n3 2 1 1": r"a.txt, line 3, initial must be 2 integers",
        "2 1 0 1\n\n3 2 1 1 2": r"a.txt, line 3, initial must be odd .* m_2=2",
        "2 1 0 1\n4 2 1 1 3": "a.txt, line 2, d must be 3, got 4",
        "2. 1 0 1": "line 1, column 1, must be non-negative integers",
        "2 2 0 1 3": "a.txt, line 1, polynomial must be irreducible .* got 0b101",
        "2 1 1 1": "a.txt, line 1, s must be in .* got s=1, a=1",
        "2 33 1 1": "a.txt, line 1, s must be in .* got s=33, a=1",
        "2 1 0": "a.txt, line 1, must be d, s, a, m_1, ..., m_s, got '2 1 0'",
    },
}  # fmt: skip
"""By reader: texts, and what is said of them."""


@pytest.mark.parametrize(("reader", "text"), [(name, text) for name in REFUSED for text in REFUSED[name]])
def test_what_is_wrong_is_named_by_line(reader, text, file):
    with pytest.raises(ValueError, match=REFUSED[reader][text]):
        getattr(sequences, reader)(file(text))


def test_wrong_digits_sizes_and_bytes_are_named_by_line(file, tmp_path):
    with pytest.raises(ValueError, match="line 3, must be the last of 4 lines, got '3 lines'"):
        sequences.read_matrices(file("1 0\n0 1\n1 1\n"), base=2)
    with pytest.raises(ValueError, match="line 2, must be digits in base 2, got '0 2'"):
        sequences.read_matrices(file("1 0\n0 2\n"), base=2)
    with pytest.raises(ValueError, match=r"line 3, must be the number of points, n=8, got '16'"):
        sequences.read_lattice(file("# lattice\n3\n16\n1\n7\n5\n"), 8)
    (tmp_path / "b.txt").write_bytes(bytes(range(256)))
    with pytest.raises(ValueError, match=r"b.txt, line 1, column 1, must be non-negative integers"):
        sequences.read_direction_numbers(tmp_path / "b.txt")
