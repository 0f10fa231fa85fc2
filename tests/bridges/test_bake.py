"""Baked tables: arrays and textures have what the sampler makes, in its leading bits, with its strata."""

import re

import numpy as np
import pytest
from refusals import refused

from qmcjax import bridges, orders, samplers, sequences
from qmcjax.bridges import bake

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
