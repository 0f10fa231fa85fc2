"""Files of points: every bit comes back, and errors name the place of what is damaged or no number."""

import gzip
import io
import re
import zipfile
import zlib

import numpy as np
import pytest
from damage import CORRUPTED, corrupted, peak

from analysis import star_discrepancy
from qmcjax import sequences
from qmcjax.bridges import read_points, write_points

POINTS = np.random.default_rng(1).random((12, 3))
POINTS[0] = [0.0, 1 - 2.0**-53, 5e-324]
ENDINGS = (".npy", ".npz", ".csv", ".dat", ".txt", ".bin")
PLACE = r"line \d+, (column \d+, |announces )|byte \d+, |array .*, |point \d+, |must contain |which must be "

TWO = [[0.1, 0.2], [0.3, 0.4]]

READ = {
    "blanks": "0.1 0.2\n0.3 0.4\n",
    "tabs and blanks around": " 0.1\t 0.2 \n\t0.3  0.4\t\n",
    "no newline at the end": "0.1 0.2\n0.3 0.4",
    "commas": "0.1,0.2\n0.3 , 0.4\n",
    "semicolons": "0.1;0.2\n0.3; 0.4\n",
    "commas at the end": "0.1,0.2,\n0.3,0.4,\n",
    "semicolons at the end": "0.1; 0.2;\n0.3; 0.4; \n",
    "both kinds of lines": "0.1 0.2\n0.3,0.4\n",
    "quotes": '"0.1" "0.2"\n"0.3" "0.4"\n',
    "quotes and commas": "'0.1','0.2'\n\"0.3\",\" 0.4 \"\n",
    "comments after points": "0.1 0.2 # first\n0.3,0.4# second, with 1 comma\n",
    "a quote in a comment": "0.1 0.2 # it's\n0.3 0.4 # 'so\n",
    "comments and blank lines before": "# made by hand\n\n  \n0.1 0.2\n\n0.3 0.4\n\n",
    "exponents": "1e-1 2.E-1\n+.3 +40.0e-02\n",
    "exponents of Fortran": "0.1D+00 0.2d0\n3.D-1 0.4D+00\n",
    "names": "u v\n0.1 0.2\n0.3 0.4\n",
    "names with commas": "x (1), the second\n0.1,0.2\n0.3,0.4\n",
    "quoted names": '"x[0]","x[1]"\n0.1,0.2\n0.3,0.4\n',
    "names after a comment": "# by pandas\r\ns_1;größe\r\n0.1;0.2\r\n0.3;0.4\r\n",
    "lines of Windows": "0.1 0.2\r\n0.3 0.4\r\n",
    "lines of the first Macs": "0.1 0.2\r0.3 0.4\r",
    "a mark of UTF-8": "\ufeff0.1 0.2\n0.3 0.4\n",
    "UTF-16": "0.1 0.2\r\n0.3 0.4\r\n".encode("utf-16"),
    "UTF-16, high byte first": "\ufeff0.1 0.2\n0.3 0.4\n".encode("utf-16-be"),
    "gzip": gzip.compress(b"0.1 0.2\n0.3 0.4\n"),
    "gzip in two parts": gzip.compress(b"0.1 0.2\n") + gzip.compress(b"0.3 0.4\n"),
    "gzip of UTF-16": gzip.compress("u,v\n0.1,0.2\n0.3,0.4".encode("utf-16")),
}

REST = "0.3 0.4\n"
WRONG = {
    "": "a.csv, must contain numbers, got an empty file",
    " \n\n": "a.csv, must contain numbers, got an empty file",
    "# one\n# two\n": "a.csv, must contain numbers, got only comments",
    "u,v\n": "a.csv, must contain points, got none",
    gzip.compress(b"", mtime=0): "a.csv, must contain numbers, got an empty file",
    gzip.compress(REST.encode(), mtime=0)[:-3]: "a.csv, byte 0, must be a whole file of gzip: ",
    '{"points": [[0.1, 0.2]]}': "line 1, column 1, must be numbers without brackets, unlike JSON, got '{",
    "[[0.1, 0.2],\n [0.3, 0.4]]": r"line 1, column 1, must be numbers without brackets, .* got '\[\[0.1'",
    "\n  {0.1f, 0.2f}\n": "line 2, column 3, must be numbers without brackets, unlike JSON, got '{0.1f'",
    f"inf inf\n{REST}": "line 1, column 1, must be a finite number, got 'inf'",
    "nan,nan\n0.3,0.4": "line 1, column 1, must be a finite number, got 'nan'",
    "NA,NA\n0.3,0.4": "line 1, column 1, must be a finite number, got 'NA' .header=True if this is a heading",
    f"0.1 -Infinity\n{REST}": "line 1, column 5, must be a finite number, got '-Infinity'",
    f"O.1 O.2\n{REST}": "line 1, column 1, must be a finite number, got 'O.1' .header=True if",
    f"0.1f 0.2f\n{REST}": "line 1, column 1, must be a finite number, got '0.1f'",
    f"x 0.2\n{REST}": "line 1, column 1, must be a finite number, got 'x'",
    ",u,v\n0,0.1,0.2": "line 1, column 1, must be a finite number, got ''",
    "0.1 0.2\nu v\n": "line 2, column 1, must be a finite number, got 'u'$",
    "0.1,0.2\n,0.4\n": "line 2, column 1, must be a finite number, got ''",
    "0.1,0.2,,\n": "line 1, column 9, must be a finite number, got ''",
    "0,1;0,2\n0,3;0,4": "line 1, column 1, must be a finite number, got '0,1'",
    '"0.1 0.2"\n': "line 1, column 1, must be a finite number, got '0.1 0.2'",
    "0.1 '0.2\n": "line 1, column 5, must be a finite number, got \"'0.2\"",
    "0.1 1e400\n": "line 1, column 5, must be a finite number, got '1e400'",
    "0.1 0x1p-2\n": "line 1, column 5, must be a finite number, got '0x1p-2'",
    "0.1 \uff10.5\n": "line 1, column 5, must be a finite number, got '\uff10.5'",
    "0.1\u00a00.5\n": "line 1, column 1, must be a finite number",
    "0.1 0.2\n0.3 0.4 0.5\n": "line 2, column 9, must have 2 coordinates, got 3",
    "1 2\n0.3 0.4\n": "line 1, column 1, may be a heading or a point: header=True or header=False must",
    "0.1 0.2\n".encode("utf-16-le"): r"line 1, column 1, must be a finite number, got '0\\x00\.",
    b"0.1 0.2\n0.3 \xe4": "line 2, column 5, must be text in utf-8, got the byte 0xe4",
    b"\xef\xbb\xbf0.5\n0.5\xff": "line 2, column 4, must be text in utf-8, got the byte 0xff",
    "0.5,,0.5\n": "line 1, column 5, must be a finite number, got ''",
    "0.1 1_0\n": "line 1, column 5, must be a finite number, got '1_0'",
    "# 2 points, 1 coordinates, crc32 00000000\n0.5\n": "line 1, announces 2 points with 1 coord.* got 1",
}  # fmt: skip


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_come_back_with_every_bit(tmp_path, ending):
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    assert np.array_equal(read_points(path, dims=3), POINTS)
    write_points(path, POINTS.astype(np.float32))
    assert np.array_equal(read_points(path, dims=3), POINTS.astype(np.float32))


def as_numpy_reads(ending, data):
    """Return the points that a damaged file without a checksum still has, by other programs."""
    if ending == ".npy":
        return np.load(io.BytesIO(data))
    if ending == ".bin":
        return np.frombuffer(data[4:], "<f8").reshape(-1, 3)[: int.from_bytes(data[:4], "little")]
    return np.loadtxt(io.StringIO(data.decode("utf-8-sig").partition("\n#")[0]), delimiter=",", ndmin=2)


@pytest.mark.parametrize("ending", ENDINGS)
def test_damaged_files_are_told_with_the_place(tmp_path, ending):
    """An error that names it, or the right points: those written; without a checksum, those there now."""
    rng = np.random.default_rng(zlib.crc32(ending.encode()))
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    whole, told = path.read_bytes(), 0
    for _ in range(CORRUPTED):
        data = corrupted(whole, rng)
        path.write_bytes(data)
        try:
            found = read_points(path, header=False if ending == ".csv" else None, dims=3)
        except ValueError as error:
            assert re.search(PLACE, str(error)) and path.name in str(error), error
            told += 1
            continue
        if not np.array_equal(found, POINTS):
            assert ending in (".npy", ".csv", ".bin"), data
            assert np.array_equal(found, as_numpy_reads(ending, data)), data
    assert told > CORRUPTED / 4


@pytest.mark.parametrize("lies", [False, True])
def test_archives_are_not_unpacked_beyond_max_bytes(tmp_path, lies):
    """65 kB that unpack to 64 MiB, even if the directory of the archive gives another size."""
    path = tmp_path / "a.npz"
    np.savez_compressed(path, few=POINTS, many=np.zeros((2**22, 2)))
    if lies:
        size = (2**26 + 128).to_bytes(4, "little")
        at = path.read_bytes().rindex(size)
        path.write_bytes(path.read_bytes()[:at] + bytes(4 - 1) + b"\1" + path.read_bytes()[at + 4 :])
    held, message = peak(lambda: read_points(path, "many", max_bytes=2**25))
    assert held < (2**24 * 2.5 if lies else 2**20)
    wanted = (
        "Bad CRC-32 for file 'many.npy'" if lies else "they must take at most max_bytes=33554432, got 671"
    )
    assert re.search(rf"a\.npz, byte \d+, must be an archive of arrays: {wanted}", message)
    if not lies:
        assert read_points(path, "many", max_bytes=2**27).shape == (2**22, 2)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_archives_are_packed_as_numpy_does(tmp_path, method):
    """Python unpacks others at once, however much that is."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as archive:
        archive.writestr("many.npy", bytes(2**24))
    held, message = peak(lambda: read_points(tmp_path / "a.npz"))
    assert held < 2**20 and "must be stored or deflated, got" in message


@pytest.mark.parametrize("ending", ENDINGS)
def test_files_larger_than_max_bytes_are_not_read(tmp_path, ending):
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    size = path.stat().st_size
    with pytest.raises(ValueError, match=rf"must take at most max_bytes={size - 1}, got {size} bytes"):
        read_points(path, dims=3, max_bytes=size - 1)
    with open(path, "ab") as file:
        file.truncate(2**40)
    with pytest.raises(ValueError, match=r"must take at most max_bytes=1073741824, got 1099511627776 bytes"):
        read_points(path, dims=3)


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


def test_point_sets_of_archives_binary_files_and_texts(tmp_path):
    np.savez(tmp_path / "a.npz", first=POINTS, second=POINTS[:4])
    # As UTK writes them: a count and the coordinates of each, or 17 decimals, and "#" between.
    parts = POINTS, POINTS[:4]
    (tmp_path / "a.bin").write_bytes(
        b"".join(np.uint32(len(part)).tobytes() + part.tobytes() for part in parts)
    )
    rows = ["\n".join(" ".join(f"{x:.17f}" for x in point) for point in part[1:]) for part in parts]
    (tmp_path / "a.dat").write_text("# comment\n" + "\n#\n".join(rows) + "\n\n#\n")
    assert np.array_equal(read_points(tmp_path / "a.npz", "second"), POINTS[:4])
    assert np.array_equal(read_points(tmp_path / "a.bin", 1, dims=3), POINTS[:4])
    assert np.allclose(read_points(tmp_path / "a.dat", 1), POINTS[1:4], rtol=0, atol=2.0**-53)
    np.save(tmp_path / "a.npy", np.arange(4))
    for name, given, message in (
        ("a.npz", {"which": "x"}, r"which must be one of \['first', 'second'\], got 'x'"),
        ("a.npz", {}, r"which must be one of \['first', 'second'\], got 0"),
        ("a.npz", {"which": "first", "dims": 2}, "dims=2 coordinates, got 3"),
        ("a.bin", {}, r"dims must be given for \.bin files"),
        ("a.dat", {"which": 2}, "which must be below the 2 point sets .* got 2"),
        ("a.dat", {"which": -1}, "which must be .* got -1"),
        ("a.npy", {}, "must contain floats"),
    ):
        with pytest.raises(ValueError, match=message):
            read_points(tmp_path / name, **given)


def test_eight_decimals_give_the_printed_discrepancy(tmp_path):
    """Z paper, Fig. 6(a): 0.000372996695 is that of the points as written to a file."""
    points = np.asarray(sequences.sobol(2).points(2**14, dtype=np.float64))
    np.savetxt(tmp_path / "net.dat", points, fmt="%.8f")
    assert round(star_discrepancy(read_points(tmp_path / "net.dat")), 12) == 0.000372996695


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


def test_headings_of_all_kinds_are_left_out_if_told(tmp_path):
    assert read_points(written(tmp_path / "a", "1 2\n0.3 0.4\n"), header=False).shape == (2, 2)
    assert read_points(written(tmp_path / "a", "0 0\n0.5 0.25\n")).shape == (2, 2)  # as C++ prints the first
    for heading in ("O.1 O.2", "nan nan", "1 2", "x-1 x-2"):
        assert np.array_equal(
            read_points(written(tmp_path / "a", f"{heading}\n{REST}"), header=True), TWO[1:]
        )


def test_other_formats_in_gzip(tmp_path):
    """The ending under .gz is that of the format, and nothing is unpacked beyond max_bytes."""
    np.save(tmp_path / "a.npy", TWO)
    packed = written(tmp_path / "b.npy.gz", gzip.compress((tmp_path / "a.npy").read_bytes()))
    assert np.array_equal(read_points(packed), TWO)
    packed = written(tmp_path / "zeros.gz", gzip.compress(bytes(10**6)))
    with pytest.raises(
        ValueError, match=r"zeros.gz, must take at most max_bytes=999999, got more when unpacked"
    ):
        read_points(packed, max_bytes=999_999)


@pytest.mark.parametrize(
    ("reader", "text"),
    [
        (sequences.read_matrices, "# dnet\n2 # base\n1\n2\n2\n2 1\n"),
        (sequences.read_lattice, "# lattice\n2\n5\n1\n2\n"),
        (sequences.read_direction_numbers, "d s a m_i\n2 1 0 1\n3 2 1 1 3\n"),
    ],
)
def test_files_of_integers_are_decoded_alike(reader, text, tmp_path):
    """By lines and encodings, packed, quoted; with what is wrong named."""
    exact = repr(reader(written(tmp_path / "plain.txt", text)))
    for data in (
        text.encode("utf-8-sig"),
        text.encode("utf-16"),
        text.replace("\n", "\r\n").encode(),
        text.replace("\n", " # a comment\n").replace("\n# l", "\n").encode(),
        f"# Any comment\n\n{text}".encode(),
        gzip.compress(text.encode()),
        re.sub(r"\b(\d)\b(?=[^#]*$)", r'"\1"', text).encode(),
        re.sub(r"(?<=\d) (?=\d)", ";", text).encode(),
    ):
        assert repr(reader(written(tmp_path / "a.txt", data))) == exact, data
    for data, message in (
        ("", "must contain numbers, got an empty file"),
        ('{"n": 5}', "line 1, column 1, must be numbers without brackets, unlike JSON"),
        (f"{text}-1\n", r"line \d, column 1, must be non-negative integers, or a comment after #, got '-1'"),
    ):
        with pytest.raises(ValueError, match=message):
            reader(written(tmp_path / "a.txt", data))
