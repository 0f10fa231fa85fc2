"""Files of points and images: every bit comes back, and what is damaged is told with its place."""

import io
import re
import struct
import sys
import tracemalloc
import zipfile
import zlib

import numpy as np
import pytest
from PIL import Image
from refusals import refused

from qmcjax.bridges import read_image, read_points, write_image, write_points

POINTS = np.random.default_rng(1).random((12, 3))
POINTS[0] = [0.0, 1 - 2.0**-53, 5e-324]
ENDINGS = (".npy", ".npz", ".csv", ".dat", ".txt", ".bin")
PLACE = r"line \d+, (column \d+, |announces )|byte \d+, |array .*, |point \d+, |must hold |which must be "
CORRUPTED = 200
"""Of each kind of file: 1,200 in all."""


@pytest.mark.parametrize("ending", ENDINGS)
def test_points_come_back_with_every_bit(tmp_path, ending):
    path = tmp_path / f"points{ending}"
    write_points(path, POINTS)
    assert np.array_equal(read_points(path, dims=3), POINTS)
    write_points(path, POINTS.astype(np.float32))
    assert np.array_equal(read_points(path, dims=3), POINTS.astype(np.float32))


def corrupted(data, rng):
    """Return bytes with one fault: cut, one bit flipped, some bytes changed, taken away, or put in."""
    at, length = int(rng.integers(len(data))), int(rng.integers(1, 9))
    anything = rng.integers(0, 256, length, np.uint8).tobytes()
    return (
        data[:at],
        data[:at] + bytes([data[at] ^ 1 << int(rng.integers(8))]) + data[at + 1 :],
        data[:at] + anything + data[at + length :],
        data[: at + 1] + data[at + 1 + length :],
        data[:at] + anything + data[at:],
    )[rng.integers(5)]


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


def test_damaged_pictures_are_told_with_the_place(tmp_path):
    rng = np.random.default_rng(3)
    path, image = tmp_path / "image.png", rng.random((6, 5, 3))
    write_image(path, image, transfer="linear", bits=16)
    whole, right = path.read_bytes(), read_image(path)
    for _ in range(CORRUPTED):
        path.write_bytes(corrupted(whole, rng))
        try:
            assert np.array_equal(read_image(path), right)
        except ValueError as error:
            assert re.search(r"image.png, (byte|row) \d+, ", str(error)), error


def peak(call):
    """Return the most bytes that Python and NumPy held during a call that raises a ValueError, and it."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError) as raised:
            call()
        return tracemalloc.get_traced_memory()[1], str(raised.value)
    finally:
        tracemalloc.stop()


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


@pytest.mark.parametrize("size", [(2**32 - 1, 2**32 - 1), (2**32 - 1, 1), (2**16, 2**16)])
@pytest.mark.parametrize("bits", [8, 16])
def test_pictures_are_as_large_as_they_say(tmp_path, size, bits):
    """Before they are unpacked: ZIP makes nothing more than 1032 times smaller."""
    path = tmp_path / "image.png"
    write_image(path, np.zeros((64, 64, 3)), transfer="linear", bits=bits)
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", *size)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    held, message = peak(lambda: read_image(path))
    wanted = (3 * bits // 8 * size[0] + 1) * size[1]
    assert held < 2**20
    assert re.search(rf"image\.png, byte 8, must have {wanted} bytes of pixels, got at most \d+$", message)


def test_byte_order_marks_and_headings(tmp_path):
    path, text = tmp_path / "points.csv", "u,v\r\n0.5, 0.25\r\n\r\n1e-3,.75\r\n"
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        path.write_text(text, encoding, newline="")
        assert np.array_equal(read_points(path), [[0.5, 0.25], [0.001, 0.75]])
    path.write_text("0,1\n0.5,0.25\n")  # as pandas heads columns without names
    with pytest.raises(ValueError, match=r"line 1, column 1, may be a heading or a point: header=True or"):
        read_points(path)
    assert read_points(path, header=True).shape == (1, 2)
    assert read_points(path, header=False).shape == (2, 2)
    path.write_text("0 0\n0.5 0.25\n")  # as C++ prints the first point of a sequence
    assert read_points(path).shape == (2, 2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.5,,0.5\n", "line 1, column 5, must be a finite number, got ''"),
        ("0.5 0.5\n0.5 nan\n", "line 2, column 5, must be a finite number, got 'nan'"),
        ("0.5 1e999\n", "line 1, column 5, must be a finite number, got '1e999'"),
        ("0.5 0.5\n0.5 0.5 0.5\n", "line 2, column 9, must have 2 coordinates, got 3"),
        ("0.5 1_0\n", "line 1, column 5"),
        ("0.5,  x\n", "line 1, column 7, must be a finite number, got 'x'"),
        ("\xef\xbb\xbf0.5\n0.5\xff", r"line 2, column 4, must be text in utf-8, got the byte 0xff"),
        ("0.5\n0.5\xff", r"line 2, column 4, must be text in utf-8, got the byte 0xff"),
        (
            "# 2 points, 1 coordinates, crc32 00000000\n0.5\n",
            "line 1, announces 2 points with 1 coord.* got 1",
        ),
    ],
)
def test_lines_and_columns_are_named(tmp_path, text, message):
    path = tmp_path / "points.dat"
    path.write_bytes(text.encode("latin1"))
    with pytest.raises(ValueError, match=message):
        read_points(path)


def test_point_sets_of_archives_and_binary_files(tmp_path):
    np.savez(tmp_path / "a.npz", first=POINTS, second=POINTS[:4])
    assert np.array_equal(read_points(tmp_path / "a.npz", "second"), POINTS[:4])
    assert np.array_equal(read_points(tmp_path / "a.npz", 1), POINTS[:4])
    with pytest.raises(ValueError, match=r"which must be one of \['first', 'second'\] or a number, got 'x'"):
        read_points(tmp_path / "a.npz", "x")
    # For each point set a count and the coordinates, as UTK writes them.
    parts = [np.uint32(len(part)).tobytes() + part.tobytes() for part in (POINTS, POINTS[:2])]
    (tmp_path / "a.bin").write_bytes(b"".join(parts))
    assert np.array_equal(read_points(tmp_path / "a.bin", 1, dims=3), POINTS[:2])
    with pytest.raises(ValueError, match=r"dims must be given for \.bin files"):
        read_points(tmp_path / "a.bin")
    with pytest.raises(ValueError, match="dims=2 coordinates, got 3"):
        read_points(tmp_path / "a.npz", dims=2)


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
    with pytest.raises(ValueError, match=f"must hold floats of shape .* got {long.dtype}"):
        read_points(tmp_path / "long.npy")
    with pytest.raises(ValueError, match=f"points: must hold floats of shape .* got {long.dtype}"):
        write_points(tmp_path / "long.csv", long)


test_wrong_arguments_are_named = refused(
    (lambda: write_image("a.png", POINTS), TypeError, "transfer must be one of .* got None"),
    (lambda: write_image("a.npy", POINTS, transfer="srgb"), ValueError, "transfer must be None except for"),
    (lambda: write_image("a.npy", [[1e300]]), ValueError, "image must be in the range of float32"),
)


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3)])
@pytest.mark.parametrize("bits", [8, 16])
def test_pictures_come_back_within_half_a_step(tmp_path, shape, bits):
    image = np.random.default_rng(2).random(shape)
    path = tmp_path / "image.png"
    write_image(path, image, transfer="linear", bits=bits)
    assert np.abs(read_image(path) - image).max() <= 0.5 / (2**bits - 1) + 1e-7
    write_image(path, image, transfer="srgb", bits=bits)
    # The slope of sRGB's curve from values to light is at most 2.4 / 1.055.
    assert np.abs(read_image(path) - image).max() <= 0.5 / (2**bits - 1) * 2.4 / 1.055 + 1e-7
    with pytest.raises(ValueError, match="transfer must be 'srgb', as the file says, got 'linear'"):
        read_image(path, transfer="linear")
    if bits == 8 or len(shape) == 2:
        whole = np.asarray(Image.open(path))
        assert whole.shape == shape and whole.max() > 0.9 * (2**bits - 1)


def picture(lines, kind=2, *between, depth=8):
    """Return a PNG file of lines, each with its filter first, and of chunks before them."""
    width = (lines.shape[1] - 1) // ({0: 1, 2: 3, 4: 2, 6: 4}[kind] * depth // 8)
    head = struct.pack(">IIBBBBB", width, len(lines), depth, kind, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n"
    packed = zlib.compress(lines.tobytes())
    for name, body in ((b"IHDR", head), *between, (b"IDAT", packed), (b"IEND", b"")):
        data += struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    return data


@pytest.mark.parametrize(("kind", "depth"), [(2, 8), (0, 16)])
def test_all_filters_are_undone_as_pillow_does(tmp_path, kind, depth):
    """Any bytes are pixels: those of rows with all five filters, at random."""
    rng = np.random.default_rng(5)
    lines = rng.integers(0, 256, (40, 1 + 3 * 17), np.uint8)
    lines[:, 0] = rng.integers(0, 5, 40)
    path = tmp_path / "image.png"
    path.write_bytes(picture(lines[:, :-1] if depth == 16 else lines, kind, depth=depth))
    expected = (np.asarray(Image.open(path)) / (2**depth - 1)).astype(np.float32)
    assert np.array_equal(read_image(path, transfer="linear"), expected)


@pytest.mark.parametrize("kind", [4, 6])
def test_alpha_is_never_srgb(tmp_path, kind):
    lines = np.tile(np.uint8([0, *[99] * 12]), (2, 1))
    path = tmp_path / "image.png"
    path.write_bytes(picture(lines, kind, (b"sRGB", b"\0")))
    found = read_image(path)
    assert np.allclose(found[..., -1], 99 / 255)
    assert np.allclose(found[..., :-1], ((99 / 255 + 0.055) / 1.055) ** 2.4)


def test_chunks_that_change_the_picture_are_not_passed_over(tmp_path):
    """An exponent that is neither of sRGB nor 1, unknown chunks that are critical, pixels too many."""
    path, lines = tmp_path / "image.png", np.tile(np.uint8([0, 99, 99, 99]), (2, 1))
    cases = (
        (picture(lines, 2, (b"gAMA", struct.pack(">I", 45455))), "the file says the exponent 0.45455"),
        (picture(lines, 2, (b"ABCD", b"")), r"byte 33, must be a chunk of an image without .* got b'ABCD'"),
        (picture(np.tile(lines, (2, 1))).replace(*sizes(4, 2)), r"byte 8, must have 8 bytes of pixels, got"),
    )
    for data, message in cases:
        path.write_bytes(data)
        with pytest.raises(ValueError, match=message):
            read_image(path)
    path.write_bytes(picture(lines, 2, (b"gAMA", struct.pack(">I", 100000)), (b"abCD", b"")))
    assert np.allclose(read_image(path), 99 / 255)


def sizes(*heights):
    """Return the first chunks of pictures that are one pixel wide."""
    heads = [b"IHDR" + struct.pack(">IIBBBBB", 1, height, 8, 2, 0, 0, 0) for height in heights]
    return [head + struct.pack(">I", zlib.crc32(head)) for head in heads]


def test_pictures_of_other_programs(tmp_path):
    path = tmp_path / "image.png"
    grey = np.arange(6, dtype=np.uint8).reshape(2, 3) * 50
    Image.fromarray(grey).save(path)
    with pytest.raises(ValueError, match="transfer must be given, for the file says nothing"):
        read_image(path)
    assert np.isclose(read_image(path, transfer="srgb")[0, 1], ((50 / 255 + 0.055) / 1.055) ** 2.4)
    Image.fromarray(grey).convert("P").save(path)
    with pytest.raises(ValueError, match="byte 8, must be an image of 8 or 16 bits without palette"):
        read_image(path, transfer="srgb")


def test_light_comes_back_with_every_bit(tmp_path):
    image = np.random.default_rng(4).exponential(2.0, (3, 4, 3)).astype(np.float32)
    write_image(tmp_path / "image.npy", image)
    assert np.array_equal(read_image(tmp_path / "image.npy"), image)
    write_image(tmp_path / "image.npy", image[..., 0])
    assert np.array_equal(read_image(tmp_path / "image.npy"), image[..., 0])
    np.save(tmp_path / "image.npy", image.astype(np.float64))
    with pytest.raises(ValueError, match="must hold float32 of shape"):
        read_image(tmp_path / "image.npy")
    image[1, 3] = np.nan
    np.save(tmp_path / "image.npy", image)
    with pytest.raises(ValueError, match=r"image\.npy, row 1, column 3, must be finite, got \[nan nan nan\]"):
        read_image(tmp_path / "image.npy")


@pytest.mark.parametrize("shape", [(3, 4), (35, 4, 3), (1, 1, 3)])
def test_exr_keeps_every_bit(tmp_path, shape):
    image = np.random.default_rng(4).exponential(2.0, shape).astype(np.float32)
    image[:, 2:] = 0.5  # compresses
    path = tmp_path / "image.exr"
    write_image(path, image)
    assert np.array_equal(read_image(path), image)


def wrong_exrs(whole):
    """Yield files whose header is cut off, whose window is too large, or whose channels have fewer pixels."""
    for end in range(8, 400, 7):
        yield whole[:end] + b"\0\0\0\0a"[: end % 6], r"byte \d+, must "
    window = whole.index(b"box2i\0") + len("box2i") + 5
    for at, number in ((8, 2**31 - 2), (8, 2**24), (8, -1), (12, -1), (12, 2**30)):
        yield whole[: window + at] + struct.pack("<i", number) + whole[window + at + 4 :], r"byte \d+, must "
    full, half = (b"G\0" + struct.pack("<4i", 2, 0, *steps) for steps in ((1, 1), (2, 1)))
    yield whole.replace(full, half), "byte 8, must have channels"


def test_exr_headers_that_are_wrong_are_refused(tmp_path):
    path = tmp_path / "image.exr"
    write_image(path, np.zeros((4, 4, 3)))
    for data, message in wrong_exrs(path.read_bytes()):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=rf"image\.exr, {message}"):
            read_image(path)


def test_exr_is_that_of_the_package(tmp_path):
    """Both ways, with all compressions; ours for scanlines and ZIP, the package for the others."""
    package = pytest.importorskip("OpenEXR")
    smooth = (np.mgrid[:40, :30].sum(axis=0) / 7).astype(np.float32)
    image = np.stack([smooth, smooth**2, np.random.default_rng(6).random((40, 30), np.float32)], axis=-1)
    path = tmp_path / "image.exr"
    write_image(path, image)
    with package.File(str(path)) as file:
        assert np.array_equal(file.channels()["RGB"].pixels, image)
        assert file.header()["comments"] == "linear light, by qmcjax"
    for name in ("NO", "RLE", "ZIPS", "ZIP", "PIZ"):
        header = {"compression": getattr(package, f"{name}_COMPRESSION"), "type": package.scanlineimage}
        for dtype in (np.float16, np.float32):
            exact = image.astype(dtype)
            with package.File(header, {"RGB": exact}) as file:
                file.write(str(path))
            assert np.array_equal(read_image(path), exact.astype(np.float32))


def test_damaged_exr_is_told_with_the_place(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    rng = np.random.default_rng(7)
    path, image = tmp_path / "image.exr", rng.random((20, 5, 3)).astype(np.float32)
    image[:, 2:] = 0.5
    write_image(path, image)
    whole = path.read_bytes()
    for _ in range(CORRUPTED):
        path.write_bytes(corrupted(whole, rng))
        try:
            assert np.array_equal(read_image(path), image)
        except ValueError as error:
            assert re.search(r"image\.exr, (byte \d+, |must have the channels )", str(error)), error
        except ImportError as error:
            assert "without the package OpenEXR (pip install 'qmcjax[exr]')" in str(error)
