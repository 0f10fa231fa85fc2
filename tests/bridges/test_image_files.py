"""Files of images: every bit comes back, and damaged files are refused."""

import io
import re
import struct
import sys
import zlib

import numpy as np
import pytest
from damage import CORRUPTED, corrupted, peak
from PIL import Image
from refusals import refused

from qmcjax import samplers, sequences
from qmcjax.bridges import _exr, _images, read_image, read_mask, write_image


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


@pytest.mark.parametrize("size", [(2**32 - 1, 2**32 - 1), (2**32 - 1, 1), (2**16, 2**16), (1, 1)])
@pytest.mark.parametrize("bits", [8, 16])
def test_pictures_are_as_large_as_they_say(tmp_path, size, bits):
    """Before they are unpacked, and no further: ZIP makes nothing more than 1032 times smaller."""
    path = tmp_path / "image.png"
    write_image(path, np.zeros((1024, 1024, 3)), transfer="linear", bits=bits)
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", *size)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    path.write_bytes(data)
    held, message = peak(lambda: read_image(path))
    wanted = (3 * bits // 8 * size[0] + 1) * size[1]
    assert held < 2**18
    assert message.endswith(f"it must have {wanted} bytes of pixels")


test_wrong_arguments_are_named = refused(
    (lambda: write_image("a.png", [[0.5]]), TypeError, "transfer must be one of .* got None"),
    (lambda: write_image("a.npy", [[0.5]], transfer="srgb"), ValueError, "transfer must be None except for"),
    (lambda: write_image("a.npy", [[1e300]]), ValueError, "image must be in the range of float32"),
)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_keeps_every_bit_and_word(channels, dtype):
    pixels = np.random.default_rng(2).integers(0, np.iinfo(dtype).max, (7, 5, channels), dtype, endpoint=True)
    for transfer, said in (("srgb", (0.45455, True)), ("linear", (1.0, False)), (None, (None, False))):
        data = _images.encode_png(pixels, {"Title": "größer"}, transfer)
        found, *says = _images.decode_png(data)
        assert found.dtype == dtype and np.array_equal(found, pixels) and tuple(says) == said
        if channels == 1 or dtype == np.uint8:  # Pillow has no others.
            assert Image.open(io.BytesIO(data)).text == {"Title": "größer"}


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
    with pytest.raises(ValueError, match="transfer must be 'srgb', as the file states, got 'linear'"):
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
    more = picture(np.tile(lines, (2, 1))).replace(*sizes(4, 2))
    cases = (
        (picture(lines, 2, (b"gAMA", struct.pack(">I", 45455))), "the file states the exponent 0.45455"),
        (picture(lines, 2, (b"ABCD", b"")), "byte 33, must be an image .*: chunk b'ABCD' is unknown"),
        (more, "byte 8, must be .*: it must have 8 bytes of pixels"),
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
    with pytest.raises(ValueError, match="transfer must be given, since the file states nothing"):
        read_image(path)
    assert np.isclose(read_image(path, transfer="srgb")[0, 1], ((50 / 255 + 0.055) / 1.055) ** 2.4)
    Image.fromarray(grey).convert("P").save(path)
    with pytest.raises(ValueError, match="byte 8, must be an image of 8 or 16 bits without palette"):
        read_image(path, transfer="srgb")


def test_every_code_is_the_light_that_srgb_says(tmp_path):
    """IEC 61966-2-1 from light to values, which it defines by the light: 12.92 times it up to 0.0031308."""
    Image.fromarray(np.arange(256, dtype=np.uint8)[None]).save(tmp_path / "image.png")
    light = read_image(tmp_path / "image.png", transfer="srgb").ravel().astype(np.float64)
    values = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(values, np.arange(256) / 255, rtol=2e-7)


def test_light_comes_back_with_every_bit(tmp_path):
    image = np.random.default_rng(4).exponential(2.0, (3, 4, 3)).astype(np.float32)
    write_image(tmp_path / "image.npy", image)
    assert np.array_equal(read_image(tmp_path / "image.npy"), image)
    write_image(tmp_path / "image.npy", image[..., 0])
    assert np.array_equal(read_image(tmp_path / "image.npy"), image[..., 0])
    np.save(tmp_path / "image.npy", image.astype(np.float64))
    with pytest.raises(ValueError, match="must contain float32 of shape"):
        read_image(tmp_path / "image.npy")
    image[1, 3] = np.nan
    np.save(tmp_path / "image.npy", image)
    with pytest.raises(ValueError, match=r"image\.npy, row 1, column 3, must be finite, got \[nan nan nan\]"):
        read_image(tmp_path / "image.npy")


@pytest.mark.parametrize("shape", [(3, 4, 1), (35, 4, 3), (1, 1, 4)])
def test_exr_keeps_every_bit(tmp_path, shape):
    """Those of numbers that are not finite included, which tables may have; our checksum is one of all."""
    pytest.importorskip("OpenEXR")
    pixels = np.random.default_rng(4).integers(0, 2**32, shape, np.uint32).view(np.float32)
    pixels[:, 2:] = 0.5  # compresses
    _exr.write_exr(tmp_path / "image.exr", pixels, "words")
    found = _exr.read_exr(tmp_path / "image.exr").pick(None)
    assert np.array_equal(found.view(np.uint32), pixels.view(np.uint32))


def wrong_exrs(whole):
    """Yield files whose header is cut off, whose window is too large, or whose channels have fewer pixels."""
    for end in range(8, 400, 7):
        yield whole[:end] + b"\0\0\0\0a"[: end % 6], r"byte \d+, must "
    window = whole.index(b"box2i\0") + len("box2i") + 5
    for at, number in ((8, 2**31 - 2), (8, 2**24), (8, -1), (12, -1), (12, 2**30)):
        yield whole[: window + at] + struct.pack("<i", number) + whole[window + at + 4 :], r"byte \d+, must "
    full, half = (b"G\0" + struct.pack("<4i", 2, 0, *steps) for steps in ((1, 1), (2, 1)))
    yield whole.replace(full, half), "byte 4, must be a whole EXR file"


def test_exr_headers_that_are_wrong_are_refused(tmp_path):
    path = tmp_path / "image.exr"
    write_image(path, np.zeros((4, 4, 3)))
    for data, message in wrong_exrs(path.read_bytes()):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=rf"image\.exr, {message}"):
            read_image(path)


def test_exr_of_other_programs(tmp_path):
    """In all compressions, and as ours are seen by the package alone."""
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


def plain_exr(channels, data, display):
    """Return an uncompressed EXR file of arrays and sampling rates, independent of the package."""
    kinds, names = {np.dtype("u4"): 0, np.dtype("f2"): 1, np.dtype("f4"): 2}, sorted(channels)
    known = [(name.encode(), kinds[channels[name][0].dtype], channels[name][1]) for name in names]
    listed = b"".join(name + struct.pack("<xiIii", kind, 0, step, step) for name, kind, step in known)
    attributes = (
        ("channels", "chlist", listed + b"\0"), ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", struct.pack("<4i", *data)), ("lineOrder", "lineOrder", b"\0"),
        ("displayWindow", "box2i", struct.pack("<4i", *display)),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)), ("screenWindowCenter", "v2f", bytes(8)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    )  # fmt: skip
    head = struct.pack("<II", 20000630, 2)
    for name, kind, body in attributes:
        head += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(body)) + body
    lines, place = [], len(head) + 1 + 8 * (data[3] - data[1] + 1)
    for y in range(data[1], data[3] + 1):
        some = [channels[name] for name in names if y % channels[name][1] == 0]
        body = b"".join(array[(y - data[1]) // step].tobytes() for array, step in some)
        lines.append(struct.pack("<ii", y, len(body)) + body)
    places = place + np.cumsum([0, *map(len, lines[:-1])])
    return head + b"\0" + places.astype("<u8").tobytes() + b"".join(lines)


def test_channels_and_windows_of_exr(tmp_path):
    """RGB beside other channels, at its place in the display window; what is not understood is named."""
    pytest.importorskip("OpenEXR")
    path, rgb = tmp_path / "image.exr", np.random.default_rng(3).random((4, 6, 3), np.float32)
    full, small = {name: (rgb[..., k], 1) for k, name in enumerate("RGB")}, np.ones((2, 3), np.float32)
    whole = (0, 0, 5, 3)
    words = np.zeros((4, 6), np.uint32)
    for more in ({"id": (words, 1)}, {"Z": (small, 2)}, {"A": (words, 1)}):
        path.write_bytes(plain_exr(full | more, whole, whole))
        assert np.array_equal(read_image(path), rgb), more
    path.write_bytes(plain_exr(full, (2, 2, 7, 5), (-1, 0, 8, 9)))
    assert np.array_equal(read_image(path), np.pad(rgb, ((2, 4), (3, 1), (0, 0))))
    chroma, halved = {"Y": full["R"], "RY": (small, 2), "BY": (small, 2)}, dict.fromkeys("RGB", (small, 2))
    for channels, data, message in (
        (chroma, whole, "Y without chroma RY and BY, got BY float32 .2, 3., RY"),
        (halved, whole, "floats of full resolution .* got B float32 .2, 3."),
        (dict.fromkeys("RGB", (words, 1)), whole, "must have floats .* B uint32"),
        (full, (2, 0, 7, 3), r"got \[\[2, 0\], \[7, 3\]\] and \[\[0, 0\], \[5, 3\]\]"),
    ):
        path.write_bytes(plain_exr(channels, data, whole))
        with pytest.raises(ValueError, match=message):
            read_image(path)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_masks_are_levels(tmp_path, dtype):
    """The last level is below 1, and integers are read alike."""
    levels = np.random.default_rng(1).integers(0, 256, (8, 8)).astype(dtype)
    levels *= dtype(np.iinfo(dtype).max // 255)
    levels[0, :2] = 0, np.iinfo(dtype).max
    path, size = tmp_path / "mask.png", 2.0 ** (8 * levels.itemsize)
    path.write_bytes(_images.encode_png(levels[..., None], {}, "srgb"))
    mask = read_mask(path)
    assert np.array_equal(mask, (levels + 0.5) / size)
    samplers_of = [samplers.dither(each, sequences.sobol(2)) for each in (mask, levels)]
    assert np.array_equal(*(sampler.offsets for sampler in samplers_of))
    assert np.array_equal(np.asarray(samplers_of[0].offsets)[..., 0] / 2.0**32, mask)
    with pytest.raises(ValueError, match=r"got 1.0 .bridges.read_mask reads the levels"):
        samplers.dither(read_image(path, transfer="srgb"), sequences.sobol(2))


@pytest.mark.parametrize("noise", [False, True])
def test_damaged_exr_is_refused(tmp_path, noise):
    """Chunks of noise are not compressed, and have no other checksum than ours."""
    pytest.importorskip("OpenEXR")
    rng = np.random.default_rng(7)
    path, image = tmp_path / "image.exr", rng.random((20, 5, 3)).astype(np.float32)
    if not noise:
        image[:, 2:] = 0.5
    write_image(path, image)
    whole = path.read_bytes()
    for _ in range(CORRUPTED):
        path.write_bytes(corrupted(whole, rng))
        try:
            assert np.array_equal(read_image(path), image)
        except ValueError as error:
            assert re.search(r"image\.exr, (byte \d+, |must have (floats|its) )", str(error)), error


def test_exr_needs_its_package(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    with pytest.raises(ImportError, match=r"without the package OpenEXR \(pip install 'qmcjax\[exr\]'\)"):
        write_image(tmp_path / "image.exr", [[0.5]])
