"""PFM and HDR files, layers of EXR files, and dithered PNG files."""

import re
import struct

import numpy as np
import pytest
from damage import CORRUPTED, corrupted
from PIL import Image
from refusals import refused

from qmcjax.bridges import oidn, read_image, write_image
from qmcjax.core import tables

RNG = np.random.default_rng(9)
HEAD = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n"


def read(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    return read_image(tmp_path / name)


@pytest.mark.parametrize("order", "<>")
def test_pfm_files_made_by_hand(tmp_path, order):
    """Rows go up; the sign of the scale is the order of bytes, its magnitude a factor."""
    sign, values = "-" if order == "<" else "", struct.pack(f"{order}6f", *range(6))
    grey = read(tmp_path, "a.pfm", f"Pf\n3 2\n{sign}1.000000\n".encode() + values)
    assert grey.dtype == np.float32 and grey.tolist() == [[3, 4, 5], [0, 1, 2]]
    colour = read(tmp_path, "a.pfm", f"PF 1 2 {sign}.5e0\r\n".encode() + values)
    assert colour.tolist() == [[[1.5, 2, 2.5]], [[0, 0.5, 1]]]


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (1, 1)])
def test_pfm_keeps_every_bit(tmp_path, shape):
    image = RNG.integers(0, 0x7F800000, shape, np.uint32).view(np.float32) * np.float32(-1)
    image.flat[0] = 1e-45
    write_image(tmp_path / "a.pfm", image)
    assert np.array_equal(read_image(tmp_path / "a.pfm").view(np.uint32), image.view(np.uint32))
    if len(shape) == 2:  # Pillow has no others.
        assert np.array_equal(np.asarray(Image.open(tmp_path / "a.pfm")), image)


def radiance(data):
    """Return the pixels of an HDR file, one byte after the other."""
    head, _, rest = data.partition(b"\n\n")
    size, _, body = rest.partition(b"\n")
    height, width = (int(size.split()[k]) for k in (1, 3))
    bytes_of, image = iter(body), []
    for _ in range(height):
        first = [next(bytes_of) for _ in range(4)]
        if 8 <= width < 32768 and first[:2] == [2, 2] and first[2] < 128:
            planes = []
            while len(planes) < 4 * width:
                code = next(bytes_of)
                run = [next(bytes_of)] * (code - 128) if code > 128 else ()
                planes += run or [next(bytes_of) for _ in range(code)]
            row = [planes[x::width] for x in range(width)]
        else:
            row = [first, *([next(bytes_of) for _ in range(4)] for _ in range(width - 1))]
        image.append([[value * 2.0 ** (e - 136) if e else 0 for value in rgb] for *rgb, e in row])
    assert next(bytes_of, None) is None and head.startswith(b"#?RADIANCE")
    return np.array(image)


@pytest.mark.parametrize("width", [1, 7, 8, 300, 33000])
def test_hdr_is_within_the_precision_of_the_format(tmp_path, width):
    """To 1/256 of the brightest channel, over the whole range, with runs and without."""
    image = (RNG.random((4, width, 3)) * 2.0 ** RNG.integers(-99, 127, (4, width, 1))).astype(np.float32)
    image[1, width // 3 :] = 0, 0.999, 0.3
    image[2, :, 1:] = image[2, :, :1]
    image[3, ::3] = 0
    image[3, -1] = 2.0**-128
    image[0, 0] = [2.0**127 * (1 - 2.0**-24), 1, 2.0**119]
    write_image(tmp_path / "a.hdr", image)
    found = read_image(tmp_path / "a.hdr")
    assert (np.abs(found - image) <= image.max(axis=-1, keepdims=True) / 256).all()
    assert np.array_equal(found, radiance((tmp_path / "a.hdr").read_bytes()))
    write_image(tmp_path / "a.hdr", image[..., 0])
    assert np.array_equal(*np.moveaxis(read_image(tmp_path / "a.hdr"), -1, 0)[:2])


def test_hdr_files_made_by_hand(tmp_path):
    """Rows that are packed and rows that are not, runs and others, and what the head says of exposure."""
    packed = b"\2\2\0\x08" + b"\x88\x80" + b"\4\1\2\3\4\x84\7" + b"\x87\0\1\xff" + b"\x82\x82\x86\x81"
    flat = bytes([128, 64, 0, 130] * 8)
    greens, exponents = (1, 2, 3, 4, 7, 7, 7, 7), (1, 1, 0, 0, 0, 0, 0, 0)
    expected = [[[2.0**e, g / 128 * 2.0**e, 0] for g, e in zip(greens, exponents, strict=True)]]
    expected[0][7][2] = 255 / 128
    expected += [[[2, 1, 0]] * 8]
    found = read(tmp_path, "a.hdr", HEAD + b"\n-Y 2 +X 8\n" + packed + flat)
    assert found.tolist() == expected
    exposed = b"#?RGBE\nEXPOSURE=2\nEXPOSURE= 4.0\nCOLORCORR=1 2 1\nGAMMA=1\n\n-Y 1 +X 1\n\x80\x40\0\x81"
    assert read(tmp_path, "a.hdr", exposed).tolist() == [[[1 / 8, 1 / 32, 0]]]


def hdr(body, size=b"-Y 1 +X 8", head=HEAD):
    return head + b"\n" + size + b"\n" + body


WHOLE = hdr(b"\2\2\0\x08" + b"\x88\1" * 4)
FALSE_FILES = (
    ("a.hdr", WHOLE[:-1], "row 0, must be one of 1 x 8 pixels, got the end"),
    ("a.hdr", WHOLE + b"\n", r"byte \d+, must be the end after 1 rows, got 1 bytes"),
    ("a.hdr", hdr(b"", b"+Y 1 +X 8"), r"must be -Y height \+X width, rows from the top, got '\+Y 1 \+X 8'"),
    ("a.hdr", hdr(b"", b"-Y 0 +X 8"), "must be -Y height"),
    ("a.hdr", hdr(b"", head=b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n"), "must have the format 32-bit_rle_rgbe"),
    ("a.hdr", hdr(b"", head=b"#?RADIANCE\nEXPOSURE=0\n"), "must have factors that are positive .* got 0"),
    ("a.hdr", hdr(b"", head=b"#?RADIANCE\nCOLORCORR=1 2\n"), "must have 1 or 3 factors as COLORCORR, got 2"),
    ("a.hdr", hdr(b"\2\2\0\x09"), "row 0, must have 8 pixels, got 9"),
    ("a.hdr", hdr(b"\2\2\0\x08\x89\1"), "row 0, must have runs that end with 8 pixels, got the code 137"),
    ("a.hdr", hdr(b"\2\2\0\x08\0"), "row 0, must have runs .* got the code 0"),
    ("a.hdr", hdr(b"\1\1\1\3" * 8), "row 0, must not have the run-length encoding before"),
    ("a.hdr", b"#?RAD", "byte 0, must be the head of a Radiance HDR file"),
    ("a.hdr", hdr(b"\0" * 9, b"-Y 999999999 +X 999999999"), "row 0, must be one of 999999999 x"),
    ("a.pfm", b"PF4\n1 1\n-1\n" + bytes(16), "byte 0, must be PF or Pf, width, height and scale"),
    ("a.pfm", b"Pf\n2 1\n-1\n" + bytes(7), "byte 10, must be 2 x 1 pixels of 1 floats, 8 bytes, got 7 bytes"),
    ("a.pfm", b"Pf\n2 1\n-1\n" + bytes(9), "got 9 bytes"),
    ("a.pfm", b"Pf\n0 1\n-1\n", "must be 0 x 1 pixels"),
    ("a.pfm", b"Pf\n1 1\n0.0\n" + bytes(4), "must have factors that are positive and finite, got 0.0"),
    ("a.pfm", b"Pf\n1 1\n1.2.3\n" + bytes(4), "must have factors that are positive and finite, got 1.2.3"),
    ("a.pfm", b"Pf\n1 2\n-1\n\0\0\xc0\x7f" + bytes(4), "row 1, column 0, must be finite, got .*nan"),
)


@pytest.mark.parametrize(("name", "data", "message"), FALSE_FILES)
def test_false_files_are_refused(tmp_path, name, data, message):
    with pytest.raises(ValueError, match=rf"{re.escape(name)}, .*{message}"):
        read(tmp_path, name, data)


@pytest.mark.parametrize("name", ["a.pfm", "a.hdr"])
def test_damaged_light_is_refused(tmp_path, name):
    """Or read as other light: these formats have no checksums."""
    write_image(tmp_path / name, RNG.random((3, 4, 3)).repeat(2, axis=1))
    whole = (tmp_path / name).read_bytes()
    for end in range(0, len(whole), 3):
        with pytest.raises(ValueError, match=rf"{name}, (byte|row) \d+, "):
            read(tmp_path, name, whole[:end])
    for _ in range(CORRUPTED):
        try:
            assert np.isfinite(read(tmp_path, name, corrupted(whole, RNG))).all()
        except ValueError as error:
            assert re.search(rf"{name}, (byte|row) \d+, ", str(error)), error


GREY = [[0.5, -0.25]]
test_wrong_arguments_are_named = refused(
    (lambda: write_image("a.hdr", GREY), ValueError, "image must be at least 0 for HDR .* row 0, column 1"),
    (lambda: write_image("a.hdr", [[2.0**127]]), ValueError, r"image must be below 2\*\*127 for HDR files"),
    (lambda: write_image("a.pfm", [[np.nan]]), ValueError, "image must be finite, got .* in row 0, column 0"),
    (lambda: write_image("a.tif", GREY), ValueError, "path must end in one of .exr, .hdr, .npy, .pfm, .png"),
    (lambda: write_image("a.pfm", GREY, dither=True), ValueError, "dither must be False except for PNG"),
    (lambda: read_image("a.pfm", layer="Z"), ValueError, "layer must be None except for EXR files, got 'Z'"),
    (lambda: oidn.read_inputs("a.png"), ValueError, "path must end in one of .exr"),
    (lambda: oidn.read_inputs("a.exr", albedo=3), TypeError, "albedo must be the name of a layer or None"),
)


def test_files_are_replaced_as_a_whole(tmp_path):
    (tmp_path / "a.png").write_text("old")
    with pytest.raises(KeyboardInterrupt), tables.replaced(tmp_path / "a.png") as path:
        path.write_text("half")
        raise KeyboardInterrupt
    assert [each.read_text() for each in tmp_path.iterdir()] == ["old"]
    write_image(tmp_path / "a.png", [[0.5]], transfer="srgb")
    assert [each.name for each in tmp_path.iterdir()] == ["a.png"]
    with pytest.raises(FileNotFoundError):
        write_image(tmp_path / "none" / "a.png", [[0.5]], transfer="srgb")


@pytest.mark.parametrize("transfer", ["srgb", "linear"])
def test_dithered_levels_have_the_mean(tmp_path, transfer):
    """Of each colour to half a threshold, from two neighbouring levels; levels themselves remain."""
    path, colours = tmp_path / "a.png", [[0.0, 0.0007, 0.0123], [0.4, 0.97, 1.0]]
    for colour in colours:
        write_image(path, np.broadcast_to(colour, (128, 256, 3)), transfer=transfer, dither=True)
        found = read_image(path)
        levels = np.asarray(Image.open(path)).reshape(-1, 3)
        assert (np.ptp(levels, axis=0) <= 1).all()
        steps = np.ptp(found.reshape(-1, 3), axis=0)
        assert (np.abs(found.mean(axis=(0, 1), dtype=float) - colour) <= steps * 2.0**-15 + 1e-7).all()
    grey = np.linspace(0, 1, 256)[None].repeat(3, axis=0)
    write_image(path, grey, transfer="linear", dither=True)
    assert np.array_equal(np.asarray(Image.open(path))[0], range(256))
    write_image(path, grey[..., None].repeat(3, axis=-1) ** 1.5, transfer="srgb", dither=True)
    assert (np.ptp(read_image(path), axis=-1) == 0).all()


def layered(path, *parts):
    """Write an EXR file of parts, each a name and channels, and return these."""
    package = pytest.importorskip("OpenEXR")
    with package.File([package.Part({}, dict(channels), name) for name, channels in parts]) as file:
        file.write(str(path))
    return {name: each for _, channels in parts for name, each in channels.items()}


def channels(*names, dtype=np.float32):
    return {name: (100 * RNG.random((3, 4))).astype(dtype) for name in names}


BLENDER = [f"ViewLayer.{name}.{c}" for name in ("Combined", "Noisy Image") for c in "RGBA"]
BLENDER += [f"ViewLayer.Denoising {each}" for each in ("Albedo.R", "Albedo.G", "Albedo.B")]
BLENDER += [*(f"ViewLayer.Denoising Normal.{each}" for each in "XYZ"), "ViewLayer.Depth.Z"]


def stacked(found, layer, components):
    return np.stack([found[f"{layer}.{each}" if layer else each] for each in components], axis=-1)


def test_layers_of_blender_and_their_inputs_of_a_denoiser(tmp_path):
    path = tmp_path / "a.exr"
    found = layered(path, ("", channels(*BLENDER) | channels("ViewLayer.IndexOB.X", "id", dtype=np.uint32)))
    for layer, components in (("Combined", "RGBA"), ("Denoising Normal", "XYZ"), ("Denoising Albedo", "RGB")):
        expected = stacked(found, f"ViewLayer.{layer}", components)
        assert np.array_equal(read_image(path, layer=f"ViewLayer.{layer}"), expected)
        assert np.array_equal(read_image(path, layer=layer), expected)
    for layer in ("ViewLayer.Depth", "Depth", "ViewLayer.Depth.Z", "Depth.Z"):
        assert np.array_equal(read_image(path, layer=layer), found["ViewLayer.Depth.Z"])
    ids = read_image(path, layer="id")
    assert ids.dtype == np.uint32 and np.array_equal(ids, found["id"])
    for wrong in (None, "Combine", "R", "ViewLayer", "", "RGBA"):
        with pytest.raises(ValueError, match=r"a\.exr, layer must be one of id; 'ViewLayer\.Combined' \(A"):
            read_image(path, layer=wrong)
    wanted = (("Noisy Image", "RGB"), ("Denoising Albedo", "RGB"), ("Denoising Normal", "XYZ"))
    for image, (layer, components) in zip(oidn.read_inputs(path), wanted, strict=True):
        assert np.array_equal(image, stacked(found, f"ViewLayer.{layer}", components))
    image, *_ = oidn.read_inputs(path, color="Combined")
    assert np.array_equal(image, stacked(found, "ViewLayer.Combined", "RGB"))
    with pytest.raises(ValueError, match=r"albedo must be a layer of 3 channels of floats, got 1 of 'Depth'"):
        oidn.read_inputs(path, albedo="Depth")


def test_parts_and_other_programs(tmp_path):
    """Colours of the first part come first; parts give names, which channels may repeat."""
    path, plain = tmp_path / "a.exr", channels(*"RGBZ", *(f"Albedo.{c}" for c in "RGB"))
    pbrt = layered(path, ("", plain | channels("Ns.X", "Ns.Y", "Ns.Z")))
    assert np.array_equal(read_image(path), stacked(pbrt, "", "RGB"))
    assert np.array_equal(read_image(path, layer="Z"), pbrt["Z"])
    wanted = [stacked(pbrt, *each) for each in (("", "RGB"), ("Albedo", "RGB"), ("Ns", "XYZ"))]
    assert all(map(np.array_equal, oidn.read_inputs(path), wanted))
    left, right = channels("R", "G", "B", "diffuse.Y"), channels("R", "G", "B", "right.normal.X")
    layered(path, ("left", left), ("right", right), ("depth", channels("Z")))
    for layer in (None, "left"):
        assert np.array_equal(read_image(path, layer=layer), stacked(left, "", "RGB"))
    assert np.array_equal(read_image(path, layer="right"), stacked(right, "", "RGB"))
    assert np.array_equal(read_image(path, layer="left.diffuse"), left["diffuse.Y"])
    assert np.array_equal(read_image(path, layer="right.normal"), right["right.normal.X"])
    with pytest.raises(ValueError, match=r"layer must be one of 'depth' \(Z\); 'left' \(B, G, R\); .*'Q'"):
        read_image(path, layer="Q")
    with pytest.raises(ValueError, match=r"a\.exr, albedo must be given, the name of one of the .* 'depth'"):
        oidn.read_inputs(path)
    only = layered(path, ("", channels(*(f"beauty.{c}" for c in "rgb"), "depth.Z")))
    assert np.array_equal(read_image(path), stacked(only, "beauty", "rgb"))
    layered(path, ("", channels(*(f"{view}.albedo.{c}" for view in "ab" for c in "RGB"), *"RGB")))
    with pytest.raises(ValueError, match=r"albedo must be given, .* may be one of 'a.albedo', 'b.albedo'"):
        oidn.read_inputs(path)
