"""Files of points: every bit comes back, and errors name the place of what is damaged or no number."""

import io
import re
import zlib

import numpy as np
import pytest
from damage import CORRUPTED, corrupted, peak

from qmcjax import sequences
from qmcjax.bridges import read_points, write_points

POINTS = np.random.default_rng(1).random((12, 3))
POINTS[0] = [0.0, 1 - 2.0**-53, 5e-324]
ENDINGS = (".npy", ".npz", ".csv", ".dat", ".txt")

TWO = [[0.1, 0.2], [0.3, 0.4]]

READ = {
    "blanks": "0.1 0.2\n0.3 0.4\n",
    "tabs and blanks around": " 0.1\t 0.2 \n\t0.3  0.4\t\n",
    "commas": "0.1,0.2\n0.3 , 0.4\n",
    "both kinds of lines": "0.1 0.2\n0.3,0.4\n",
    "comments after points": "0.1 0.2 # first\n0.3,0.4# second, with 1 comma\n",
    "a quote in a comment": "0.1 0.2 # it's\n0.3 0.4 # 'so\n",
    "exponents": "1e-1 2.E-1\n+.3 +40.0e-02\n",
    "lines of Windows": "0.1 0.2\r\n0.3 0.4\r\n",
    "lines of the first Macs": "0.1 0.2\r0.3 0.4\r",
    "a mark of UTF-8": "\ufeff0.1 0.2\n0.3 0.4\n",
}

REST = "0.3 0.4\n"
WRONG = {
    "": "a.csv, which must be below the 0 point sets in it, got 0",
    " \n\n# one\n": "a.csv, which must be below the 0 point sets in it, got 0",
    "[[0.1, 0.2],\n [0.3, 0.4]]": r"line 1, column 1, must be a finite number, got '\[\[0.1'",
    f"u v\n{REST}": "line 1, column 1, must be a finite number, got 'u'",
    "nan,nan\n0.3,0.4": "line 1, column 1, must be a finite number, got 'nan'",
    f"0.1 -Infinity\n{REST}": "line 1, column 5, must be a finite number, got '-Infinity'",
    "0.1 0.2\nu v\n": "line 2, column 1, must be a finite number, got 'u'",
    "0.1, 0.2 ,\n": "line 1, column 11, must be a finite number, got ''",
    "0,1;0,2\n0,3;0,4": "line 1, column 3, must be a finite number, got '1;0'",
    '"0.1" 0.2\n': "line 1, column 1, must be a finite number, got '\"0.1\"'",
    "0.1 1e400\n": "line 1, column 5, must be a finite number, got '1e400'",
    "0.1 1.5D-1\n": "line 1, column 5, must be a finite number, got '1.5D-1'",
    "0.1 0x1p-2\n": "line 1, column 5, must be a finite number, got '0x1p-2'",
    "0.1 \uff10.5\n": "line 1, column 5, must be a finite number, got '\uff10.5'",
    "0.1,0.2 0.3\n": "line 1, column 5, must be a finite number, got '0.2 0.3'",
    "0.1 0.2\n0.3 0.4 0.5\n": "line 2, must have 2 coordinates, got '3'",
    "0.1 0.2\n".encode("utf-16"): "line 1, column 1, must be a finite number",
    b"0.1 0.2\n0.3 \xe4": "line 2, column 5, must be a finite number, got '\ufffd'",
    "0.1 1_0\n": "line 1, column 5, must be a finite number, got '1_0'",
}  # fmt: skip


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_come_back_with_every_bit(tmp_path, ending):
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    assert np.array_equal(read_points(path), POINTS)
    write_points(path, POINTS.astype(np.float32))
    assert np.array_equal(read_points(path), POINTS.astype(np.float32))


def as_numpy_reads(ending, data):
    """Return the points that a damaged file without a checksum still has, by NumPy."""
    if ending == ".npy":
        return np.load(io.BytesIO(data))
    text = data.decode("utf-8", "replace").partition("\n#")[0]
    return np.loadtxt(io.StringIO(text), delimiter="," if ending == ".csv" else None, ndmin=2)


@pytest.mark.parametrize("ending", ENDINGS)
def test_damaged_files_are_named_or_as_numpy_reads_them(tmp_path, ending):
    """Those of an archive, with checksums, are the points written."""
    rng = np.random.default_rng(zlib.crc32(ending.encode()))
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    whole, refused = path.read_bytes(), 0
    for _ in range(CORRUPTED):
        data = corrupted(whole, rng)
        path.write_bytes(data)
        try:
            found = read_points(path)
        except ValueError as error:
            assert path.name in str(error), error
            refused += 1
            continue
        if not np.array_equal(found, POINTS):
            assert ending != ".npz" and np.array_equal(found, as_numpy_reads(ending, data)), data
    assert refused > CORRUPTED / 5


def test_archives_are_not_unpacked_beyond_max_bytes(tmp_path):
    """65 kB that unpack to 64 MiB."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, few=POINTS, many=np.zeros((2**22, 2)))
    held, message = peak(lambda: read_points(path, "many", max_bytes=2**25))
    assert held < 2**20
    assert re.search(r"a\.npz, must take at most max_bytes=33554432, got 671\d{5} bytes", message)
    assert read_points(path, "many", max_bytes=2**27).shape == (2**22, 2)


@pytest.mark.parametrize("ending", ENDINGS)
def test_files_larger_than_max_bytes_are_not_read(tmp_path, ending):
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    size = path.stat().st_size
    with pytest.raises(ValueError, match=rf"must take at most max_bytes={size - 1}, got {size} bytes"):
        read_points(path, max_bytes=size - 1)
    with open(path, "ab") as file:
        file.truncate(2**40)
    with pytest.raises(ValueError, match=r"must take at most max_bytes=1073741824, got 1099511627776 bytes"):
        read_points(path)


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_arrays_are_those_that_numpy_reads(tmp_path, version):
    """Of all versions of its format, by columns or by rows, in the other order of bytes."""
    for points in (POINTS, np.asfortranarray(POINTS), POINTS.astype(">f8")):
        with (tmp_path / "a.npy").open("wb") as file:
            np.lib.format.write_array(file, points, version=version)
        assert np.array_equal(read_points(tmp_path / "a.npy"), POINTS)


@pytest.mark.skipif(np.finfo(np.longdouble).bits == 64, reason="there are no longer floats")
def test_floats_with_more_digits_are_not_cut_off(tmp_path):
    long = np.array([[1 / np.longdouble(3)]])
    np.save(tmp_path / "long.npy", long)
    with pytest.raises(ValueError, match=f"must contain floats of shape .* got {long.dtype}"):
        read_points(tmp_path / "long.npy")
    with pytest.raises(ValueError, match=f"points: must contain floats of shape .* got {long.dtype}"):
        write_points(tmp_path / "long.csv", long)


def test_point_sets_of_archives_and_texts(tmp_path):
    np.savez(tmp_path / "a.npz", first=POINTS, second=POINTS[:4])
    # As UTK writes them: 17 decimals, and "#" between.
    rows = ["\n".join(" ".join(f"{x:.17f}" for x in p) for p in part[1:]) for part in (POINTS, POINTS[:4])]
    (tmp_path / "a.dat").write_text("# comment\n" + "\n#\n".join(rows) + "\n\n#\n")
    assert np.array_equal(read_points(tmp_path / "a.npz", "second"), POINTS[:4])
    assert np.allclose(read_points(tmp_path / "a.dat", 1), POINTS[1:4], rtol=0, atol=2.0**-53)
    np.save(tmp_path / "a.npy", np.arange(4))
    for name, which, message in (
        ("a.npz", "x", r"a\.npz, which must be one of \['first', 'second'\], got 'x'"),
        ("a.npz", 0, r"which must be one of \['first', 'second'\], got None"),
        ("a.dat", 2, "which must be below the 2 point sets .* got 2"),
        ("a.dat", -1, "which must be .* got -1"),
        ("a.npy", 0, "must contain floats"),
    ):
        with pytest.raises(ValueError, match=message):
            read_points(tmp_path / name, which)


def written(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize("name", READ)
def test_files_that_are_read(name, tmp_path):
    assert np.array_equal(read_points(written(tmp_path / "a.csv", READ[name])), TWO)


@pytest.mark.parametrize("text", WRONG)
def test_files_that_are_refused_with_the_place(text, tmp_path):
    with pytest.raises(ValueError) as raised:
        read_points(written(tmp_path / "a.csv", text))
    assert re.search(WRONG[text], str(raised.value)), raised.value


def test_headings_are_left_out_if_told(tmp_path):
    for heading in ("u v", "nan nan", "1 2", '"x[0]";"x[1]"'):
        path = written(tmp_path / "a", f"# by pandas\n\n{heading}\n{REST}")
        assert np.array_equal(read_points(path, header=True), TWO[1:])


INTEGERS = [
    (sequences.read_matrices, "# dnet\n2 # base\n1\n2\n2\n2 1\n"),
    (sequences.read_lattice, "# lattice\n2\n5\n1\n2\n"),
    (sequences.read_direction_numbers, "d s a m_i\n2 1 0 1\n3 2 1 1 3\n"),
]


@pytest.mark.parametrize("reader, text", INTEGERS)
def test_files_of_integers_are_decoded_alike(reader, text, tmp_path):
    """With lines of Windows, comments and commas; with what is wrong named."""
    exact = repr(reader(written(tmp_path / "plain.txt", text)))
    for data in (
        text.encode("utf-8-sig"),
        text.replace("\n", "\r\n").encode(),
        text.replace("\n", " # a comment\n").replace("\n# l", "\n").encode(),
        f"# Any comment\n\n{text}".encode(),
        re.sub(r"(?<=\d) (?=\d)", ",", text).encode(),
    ):
        assert repr(reader(written(tmp_path / "a.txt", data))) == exact, data
    for data, message in (
        ("", "a.txt, must contain integers, got none"),
        ('{"n": 5}', "line 1, column 1, must be non-negative integers, or a comment after #, got '{"),
        (f"{text}-1\n", r"line \d, column 1, must be non-negative integers, or a comment after #, got '-1'"),
    ):
        with pytest.raises(ValueError, match=message):
            reader(written(tmp_path / "a.txt", data))
