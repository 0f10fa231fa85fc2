"""Small files of numbers as programs write them: the points, or the place of what is wrong."""

import gzip
import re

import numpy as np
import pytest

from qmcjax import sequences
from qmcjax.bridges import read_points

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
    "": "a.csv, must hold numbers, got an empty file",
    " \n\n": "a.csv, must hold numbers, got an empty file",
    "# one\n# two\n": "a.csv, must hold numbers, got nothing but comments",
    "u,v\n": "a.csv, must hold points, got none",
    gzip.compress(b""): "a.csv, must hold numbers, got an empty file",
    gzip.compress(REST.encode())[:-3]: "a.csv, byte 0, must be a whole file of gzip: ",
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
}  # fmt: skip


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
        ("", "must hold numbers, got an empty file"),
        ('{"n": 5}', "line 1, column 1, must be numbers without brackets, unlike JSON"),
        (f"{text}-1\n", r"line \d, column 1, must be non-negative integers, or a comment after #, got '-1'"),
    ):
        with pytest.raises(ValueError, match=message):
            reader(written(tmp_path / "a.txt", data))
