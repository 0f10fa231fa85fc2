"""Baked tables: arrays and textures have what the sampler makes, in its leading bits, with its strata."""

import re

import numpy as np
import pytest
from refusals import refused
from tables import SAMPLERS

from qmcjax import bridges, orders, samplers, sequences
from qmcjax.bridges import PlainSampler, bake

SAMPLER = samplers.independent(sequences.sobol(5), key=3)
TILE, SPP, DIMS = (6, 4), 8, (0, 1, 2, 3, 4)
X, Y, S = np.meshgrid(np.arange(6), np.arange(4), np.arange(8))


@pytest.fixture(scope="module")
def tables():
    return {bits: bake(SAMPLER, TILE, SPP, DIMS, bits) for bits in (8, 16, 24, 32)}


def test_values_are_the_leading_bits(tables):
    words = (np.asarray(SAMPLER(X, Y, S, DIMS, np.float64)) * 2.0**32).astype(np.uint32)
    for bits, table in tables.items():
        values = table.values * 2.0**24 if bits == 24 else table.values
        assert table.values.itemsize == max(bits, 32 * (bits == 24)) // 8
        assert np.array_equal(values, words >> np.uint32(32 - bits))
    assert np.array_equal(tables[24].points, SAMPLER(X, Y, S, DIMS))
    assert np.array_equal(tables[16].points, ((words >> 16) + 0.5) / 2**16)
    assert np.array_equal(tables[32].points, words / 2.0**32)


def places(table):
    """Return column, row and channel of all values, as the file says."""
    said = "column (.*) and row (.*), rounded down, with l = (.*), and in channel (j % .) of "
    column, row, line, channel = re.findall(said, table.readme)[0]
    y, x, s, j = np.indices(table.values.shape)
    names = {"x": x, "y": y, "s": s, "j": j}
    names["l"] = eval(line.replace("/", "//"), names)
    return [eval(each.replace("/", "//"), names) for each in (column, row, channel)]


@pytest.mark.parametrize("coordinates", [1, 2, 5])
@pytest.mark.parametrize(("bits", "ending"), [(8, "png"), (16, "png"), (24, "exr")])
def test_textures_have_the_very_bits(tmp_path, bits, ending, coordinates):
    """Where the text in the file says; what is not used is black."""
    table, path = bake(SAMPLER, TILE, 5, DIMS[:coordinates], bits), tmp_path / f"table.{ending}"
    table.save(path)
    texels = bridges.read_image(path)  # of PNG, values as light
    texels = np.rint(texels * (2**bits - 1)).astype(np.uint32) if ending == "png" else texels
    texels = texels if texels.ndim == 3 else texels[..., None]
    column, row, channel = places(table)
    assert f"Texels: {texels.shape[1]} x {texels.shape[0]}, from the top." in table.readme
    assert np.array_equal(texels[row, column, channel], table.values)
    assert np.count_nonzero(texels) == np.count_nonzero(table.values)


def test_words_are_in_the_files(tables, tmp_path):
    table = tables[16]
    table.save(tmp_path / "table.png")
    assert table.readme.encode() in (tmp_path / "table.png").read_bytes()
    assert "Independent(sobol(dims=5))" in table.readme and "values" not in repr(table)


@pytest.mark.parametrize("bits", [8, 16, 24, 32])
def test_words_say_what_coordinates_are(tables, bits):
    (formula,) = re.findall("A coordinate is (?:the )?(.*)[.]", tables[bits].readme)
    found = eval(formula, {"value": tables[bits].values.astype(np.float64)})
    assert np.array_equal(found, tables[bits].points)


def boxes(words, a, b):
    """Return how many points of each set are in each box of 2**-a x 2**-b."""
    cells = ((words[..., 0].astype(np.int64) >> (32 - a)) << b) | (words[..., 1].astype(np.int64) >> (32 - b))
    return np.stack([np.bincount(each, minlength=2 ** (a + b)) for each in cells.reshape(len(words), -1)])


def test_strata_are_kept():
    """Of every pixel, and with 16 bits of 256 pixels together: each box of volume 2**-m has one point."""
    sequence = sequences.owen(sequences.sobol(2), key=1)
    sampler = samplers.contiguous(orders.hilbert(16, 16), sequence, spp=16)
    words = bake(sampler, (16, 16), 16, bits=16).values.astype(np.uint32) << 16
    for a in range(5):
        assert np.all(boxes(words.reshape(256, 16, 2), a, 4 - a) == 1)
    for a in range(13):
        assert np.all(boxes(words.reshape(1, 4096, 2), a, 12 - a) == 1)
    owen = samplers.independent(sequences.sobol(2), key=1)
    words = bake(owen, (2, 1), 511, bits=8).values.astype(np.uint32) << 24
    assert np.all(boxes(words.reshape(2, 511, 2)[:, :256], 8, 0) == 1)
    with pytest.raises(ValueError, match="bits must be more than 8 for strata of 512 samples"):
        bake(owen, (2, 1), 512, bits=8)


def test_tables_are_made_in_pieces(monkeypatch):
    from qmcjax.bridges import _plain

    whole = bake(SAMPLER, TILE, SPP, DIMS).values
    monkeypatch.setattr(_plain, "PIECE", 3 * 6 * SPP * 5)
    assert np.array_equal(bake(SAMPLER, TILE, SPP, DIMS).values, whole)


test_wrong_arguments_are_named = refused(
    (lambda: bake(SAMPLER, (4096, 4096), 64), ValueError, "tile, spp and dims must make at most"),
    (lambda: bake(SAMPLER, (1, 1), 1).save("a.exr"), ValueError, r"bits must be one of \(24,\) for .exr"),
    (lambda: bake(SAMPLER, (1, 1), 1, bits=32).save("a.png"), ValueError, r"one of \(8, 16\) for .png"),
    (lambda: bake(SAMPLER, (1, 1), 1).save("a.x"), ValueError, "path must end in one of"),
)


OWEN = sequences.owen(sequences.sobol(5), key=1)
CURVE = samplers.contiguous(orders.hilbert(20, 18), OWEN, spp=12)


def numbers(plain, x, y, sample, kinds):
    plain.start((x, y), sample)
    found = []
    for kind in kinds:
        found += [plain.get1d()] if kind == 1 else plain.get2d()
    return found


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_numbers_are_the_samplers_in_any_order(dtype):
    """Tables at the lower and right edge, and of the last samples, begin early enough to be whole."""
    plain, rng = PlainSampler(CURVE, dtype), np.random.default_rng(1)
    x, y, s = rng.integers(0, 20, 60), rng.integers(0, 18, 60), rng.integers(0, 12, 60)
    x[0], y[0], s[0] = 19, 17, 11
    expected = np.asarray(CURVE(x, y, s, tuple(range(5)), dtype))
    for k in range(60):
        kinds = ((2, 1, 2), (1, 1, 1, 2), (2, 2, 1))[k % 3]
        assert numbers(plain, x[k], y[k], s[k], kinds) == expected[k].tolist()
    assert type(numbers(plain, 0, 0, 0, [1])[0]) is float


def test_arrays_are_the_samplers():
    plain = PlainSampler(CURVE)
    y, x, s = np.ogrid[:18, :20, :3]
    found = plain.array(20, 18, 3, (4, 0))
    assert found.dtype == np.float32 and np.array_equal(found, CURVE(x, y, s, (4, 0)))
    shared = np.from_dlpack(found)
    assert shared.__array_interface__["data"] == found.__array_interface__["data"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SAMPLERS))
def test_every_sampler_has_its_numbers(name):
    sampler = SAMPLERS[name]
    plain = PlainSampler(sampler)
    width, height, spp = (min(limit, 20) for limit in sampler.fits.limits)
    where = np.array([(0, 0, 0), (width - 1, height // 2, spp - 1)], np.uint32)
    expected = np.asarray(sampler(*where.T, tuple(range(sampler.dims))))
    for (x, y, s), points in zip(where.tolist(), expected.tolist(), strict=True):
        assert numbers(plain, x, y, s, [1] * sampler.dims) == points


def test_tables_are_made_once(monkeypatch):
    from qmcjax.bridges import _plain

    made = []

    def counted(sampler, corner, size, first, count, dims, dtype):
        made.append((corner, first))
        return np.zeros((*size[::-1], count, len(dims)), dtype)

    monkeypatch.setattr(_plain, "pixel_points", counted)
    plain = PlainSampler(samplers.independent(sequences.sobol(2), key=1))
    for y in range(32):
        for x in range(48):
            for s in range(16):
                plain.start((x, y), s)
    assert len(made) == len(set(made)) == 2 * 3 * 2
    # The last samples are in a table that ends with them; there are none beyond.
    PlainSampler(CURVE).start((19, 17), 11)
    assert made[-1] == ((20 - 16, 18 - 16), 12 - 8)
    # With hundreds of dimensions tables have few pixels.
    PlainSampler(samplers.independent(sequences.sobol(400), key=1)).start((5, 6), 9)
    assert made[-1] == ((4, 4), 8)


def test_there_are_no_more_coordinates_than_the_samplers():
    plain = PlainSampler(samplers.function(lambda x, y, s: np.full((*s.shape, 3), 0.25, np.float32), 3))
    with pytest.raises(ValueError, match=r"call start\(pixel, sample\) before"):
        plain.get1d()
    plain.start((3, 4), 5)
    assert plain.get2d() == (0.25, 0.25)
    with pytest.raises(ValueError, match="have 2 more coordinates, got 2 of dims=3 taken"):
        plain.get2d()
    assert plain.get1d() == 0.25


test_wrong_calls_are_named = refused(
    (lambda: PlainSampler(CURVE).start(3, 0), TypeError, "pixel must be column and row, got 3"),
    (lambda: PlainSampler(CURVE).start((20, 0), 0), ValueError, r"pixel must be .* \[0, 19\], got 20"),
    (lambda: PlainSampler(CURVE).start((0, 0), 12), ValueError, r"sample must be .* \[0, 11\], got 12"),
    (lambda: PlainSampler(CURVE).array(9, 9, 1), ValueError, "width, height must be the sampler's 20 x 18"),
)
