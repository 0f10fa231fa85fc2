"""Baked tables: what C, C++ and GLSL read is what the sampler makes, in its leading bits, with its strata."""

import re
import shutil
import subprocess
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
import webgl
from refusals import refused

from qmcjax import bridges, orders, samplers, sequences
from qmcjax.bridges import BakedTable, bake, bake_mask, bake_matrices, bake_order, bake_ranked
from qmcjax.bridges._bake import broken_strata
from qmcjax.bridges._table import Layout

SAMPLER = samplers.independent(sequences.sobol(5), key=3)
TILE, SPP, DIMS = (6, 4), 8, (0, 1, 2, 3, 4)
X, Y, S = np.meshgrid(np.arange(6), np.arange(4), np.arange(8))
compiles = pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")

LOOPS = """
int main(int, char** arguments) {{
    {load}
    for (uint32_t y = 0; y < 2 * {rows}; ++y)
        for (uint32_t x = 0; x < 2 * {columns}; ++x)
            for (uint32_t s = 0; s < {samples}; ++s)
                for (uint32_t {j} = 0; {j} < {count}; ++{j}) {{ {read} }}
}}
"""


def run(folder, source, *arguments):
    """Compile and run a program, without warnings; return the bytes that it writes."""
    (folder / "main.cpp").write_text(source)
    command = ["g++", "-O1", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function"]
    command += ["-ffp-contract=off", "main.cpp", "-o", "main"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert not done.returncode, done.stderr
    command = ["./main", *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, check=True).stdout


def loops(table, load, j, count, read):
    rows, columns, samples, _ = table.values.shape
    return LOOPS.format(load=load, rows=rows, columns=columns, samples=samples, j=j, count=count, read=read)


def width_of(table):
    """Return the width of the texture, as the reader says it."""
    return int(re.search(r"Texture: (\d+) x", table.reader("glsl"))[1])


def repeated(values):
    """Return four tiles, as readers see beyond the first one."""
    return np.tile(values, (2, 2, 1, 1))


@pytest.fixture(scope="module")
def tables():
    return {bits: bake(SAMPLER, TILE, SPP, DIMS, bits) for bits in (8, 16, 24, 32)}


def test_values_are_the_leading_bits(tables):
    words = (np.asarray(SAMPLER(X, Y, S, DIMS, np.float64)) * 2.0**32).astype(np.uint32)
    for bits, table in tables.items():
        values = table.values * 2.0**24 if bits == 24 else table.values
        assert np.array_equal(values, words >> np.uint32(32 - bits))
    assert np.array_equal(tables[24].points, SAMPLER(X, Y, S, DIMS))
    assert np.array_equal(tables[16].points, ((words >> 16) + 0.5) / 2**16)
    assert np.array_equal(tables[32].points, words / 2.0**32)


@compiles
@pytest.mark.slow
@pytest.mark.parametrize("bits", [16, 24])
def test_cpp_reads_the_very_bits(tables, tmp_path, bits):
    table = tables[bits]
    table.save(tmp_path / ("table.rg16" if bits == 16 else "table.rgba32f"))
    assert "Texels: " in next(tmp_path.glob("table.*.txt")).read_text()
    read = "float v = points.point(x, y, s, j); std::fwrite(&v, 4, 1, stdout);"
    source = table.reader("cpp") + loops(table, "table points(arguments[1]);", "j", 5, read)
    found = np.frombuffer(run(tmp_path, source, *tmp_path.glob("table.rg*[6f]")), np.float32)
    assert np.array_equal(found, repeated(table.points).ravel())
    assert table.reader("cpp").count("\n") < 40


GLSL = """
uniform highp {sampler} texels;
{reader}
void mine(uint x, uint y, uint s, out float u[6]) {{
    for (uint g = 0u; g < {groups}u; g++) {{
        {vector} values = table_point(texels, x, y, s, g);
        for (int c = 0; c < {channels} && int(g) * {channels} + c < 6; c++)
            u[int(g) * {channels} + c] = values[c];
    }}
}}
"""


@pytest.mark.browser
@pytest.mark.skipif(webgl.CHROMIUM is None, reason="no chromium (Debian: chromium)")
def test_glsl_reads_the_very_bits_in_webgl(tables, tmp_path):
    """At random pixels of four tiles, beside and below each other."""
    cases, limits, count = [], (2 * TILE[0], 2 * TILE[1], SPP), webgl.COLUMNS
    for bits, kind, channels in ((16, "RG16UI", 2), (24, "RGBA32F", 4)):
        table, path = tables[bits], tmp_path / ("table.rg16" if bits == 16 else "table.rgba32f")
        table.save(path)
        reader = table.reader("glsl")
        size = [int(side) for side in re.search(r"Texture: (\d+) x (\d+)", reader).groups()]
        sampler = "usampler2D" if bits == 16 else "sampler2D"
        how = {
            "sampler": sampler,
            "vector": f"vec{channels}",
            "channels": channels,
            "groups": -(-5 // channels),
        }
        texels = webgl.texture("texels", kind, size, np.fromfile(path, np.uint8))
        text = GLSL.format(reader=reader, **how)
        cases.append(webgl.case(text, "sampler", count, limits, 6, whole=True, given=texels))
        assert reader.count("\n") <= 20
    x, y, s = webgl.drawn(count, limits)
    for found, bits in zip(webgl.run(tmp_path, cases), (16, 24), strict=True):
        assert not isinstance(found, str), found
        assert np.array_equal(found[:, :5].view(np.float32), repeated(tables[bits].points)[y, x, s])


@compiles
@pytest.mark.slow
def test_headers_have_the_very_bits(tables, tmp_path):
    """Of all depths in one program."""
    parts, reads, expected = [], [], []
    for bits, table in tables.items():
        table.save(tmp_path / f"of-{bits}.h")
        parts.append(f'#include "of-{bits}.h"')
        reads.append(f"{{ float v = of_{bits}_point(x, y, s, j); std::fwrite(&v, 4, 1, stdout); }}")
        expected.append(tables[24].points if bits == 32 else table.points)
    parts += [loops(table, "(void)arguments;", "j", 5, " ".join(reads))]
    source = "\n".join(["#include <cstdio>", *parts])
    found = np.frombuffer(run(tmp_path, source), np.float32).reshape(8, 12, SPP, 5, 4)
    assert np.array_equal(found, np.stack([repeated(each) for each in expected], axis=-1))


def of_texture(texels, table, x, y, s, j):
    """Return one value as the words in the file say."""
    rows, columns, _, coordinates = table.values.shape
    channels = 4 if table.bits == 24 else 2
    layer = s * -(-coordinates // channels) + j // channels
    across = width_of(table) // columns
    return texels[layer // across * rows + y, layer % across * columns + x, j % channels]


FILES = [(8, "png"), (16, "png"), (16, "rg16"), (24, "rgba32f"), (24, "exr")]


@pytest.mark.parametrize(("bits", "ending"), FILES)
def test_textures_have_the_very_bits(tables, tmp_path, bits, ending):
    table, path = tables[bits], tmp_path / f"table.{ending}"
    table.save(path)
    if ending in ("png", "exr"):
        texels = bridges.read_image(path)  # of PNG, values as light
        texels = np.rint(texels * (2**bits - 1)).astype(np.uint32) if ending == "png" else texels
    else:
        raw = np.fromfile(path, "<u2" if bits == 16 else "<f4")
        texels = raw.reshape(-1, 4 * TILE[0], 4 if bits == 24 else 2)
    for x, y, s, j in np.random.default_rng(1).integers(0, (*TILE, SPP, 5), (50, 4)):
        assert of_texture(texels, table, x, y, s, j) == table.values[y, x, s, j]


def test_what_is_not_used_of_a_texture_is_black():
    """Of five layers side by side in pairs, the sixth."""
    table = bake(SAMPLER, (3, 2), 5, (0,))
    texels = Layout(2, 3, 5, 1, 2).texels(np.ones_like(table.values))
    assert texels.shape == (6, 6, 2) and texels.sum() == table.values.size
    assert not texels[4:, 3:].any() and not texels[..., 1].any()


def test_words_are_in_the_files(tables, tmp_path):
    table = tables[16]
    table.save(tmp_path / "table.npz")
    table.save(tmp_path / "table.h")
    table.save(tmp_path / "table.png")
    with np.load(tmp_path / "table.npz") as found:
        assert np.array_equal(found["values"], table.values) and str(found["readme"]) == table.readme
    for line in table.readme.splitlines():
        assert f"// {line}\n" in (tmp_path / "table.h").read_text()
    assert table.readme.encode() in (tmp_path / "table.png").read_bytes()
    assert "Independent(sobol(dims=5))" in table.readme
    replace(table, about=("ends in \\",)).save(tmp_path / "table.h")
    assert "\\" not in (tmp_path / "table.h").read_text(), "the next line would be a comment"


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_words_say_what_coordinates_are(tables, bits):
    formula = re.search("A coordinate is (.*)[.]", tables[bits].readme)[1]
    found = eval(formula, {"value": tables[bits].values.astype(np.float64)})
    assert np.array_equal(found, tables[bits].points)


def boxes(words, a, b):
    """Return how many points of each set are in each box of 2**-a x 2**-b."""
    cells = ((words[..., 0].astype(np.int64) >> (32 - a)) << b) | (words[..., 1].astype(np.int64) >> (32 - b))
    return np.stack([np.bincount(each, minlength=2 ** (a + b)) for each in cells.reshape(len(words), -1)])


def test_strata_are_kept():
    """Of every pixel, and of 256 pixels together: each box of volume 2**-m has one point, as stored."""
    sequence = sequences.owen(sequences.sobol(2), key=1)
    sampler = samplers.contiguous(orders.hilbert(16, 16), sequence, spp=16)
    table = bake(sampler, (16, 16), 16, bits=16)
    words = table.values.astype(np.uint32) << 16
    for a in range(5):
        assert np.all(boxes(words.reshape(256, 16, 2), a, 4 - a) == 1)
    for a in range(13):
        assert np.all(boxes(words.reshape(1, 4096, 2), a, 12 - a) == 1)
    assert table.about[-1] == "All points together keep their elementary intervals."
    coarse = bake(sampler, (16, 16), 16, bits=8)
    words = coarse.values.astype(np.uint32) << 24
    assert np.all(boxes(words.reshape(256, 16, 2), 4, 0) == 1)
    assert np.max(boxes(words.reshape(1, 4096, 2), 12, 0)) == 16
    assert "1 x 1/4096 4096 have a point, 256 as stored" in coarse.about[-1]
    # 300 samples have 256 strata, which 8 bits keep.
    bake(SAMPLER, (2, 1), 300, bits=8)


@pytest.mark.parametrize("axis", [0, 1])
def test_one_bit_less_than_the_strata_have_is_told(axis):
    """512 intervals of 9 digits; 9 bits keep them."""
    words = np.zeros((1, 512, 2), np.uint32)
    words[0, :, axis] = np.arange(512) << 23
    shape = ("1/512 x 1", "1 x 1/512")[axis]
    assert str(broken_strata(words, 8)) == f"of the boxes {shape} 512 have a point, 256 as stored"
    assert broken_strata(words, 9) is None


@pytest.mark.slow
def test_strata_that_would_break_are_refused():
    sampler = samplers.independent(sequences.sobol(3), key=1)
    assert bake(sampler, (2, 1), 256, (0, 1, 2), bits=8).values.shape == (1, 2, 256, 3)
    message = r"bits must be more than 8 for strata of 512 samples: of the boxes 1 x 1/512 1024 have"
    with pytest.raises(ValueError, match=message):
        bake(sampler, (2, 1), 512, bits=8)
    # A single coordinate, and the last of three, have intervals only.
    for dims in ((2,), (0, 1, 2)):
        with pytest.raises(ValueError, match="for strata of 512 samples"):
            bake(sampler, (1, 1), 512, dims, bits=8)
    # In any pair: here the first has all samples in one place.
    sobol = sequences.sobol(3)
    for dims, named in ((4, "1 x 1/512"), (3, "1/512 x 1")):
        later = samplers.function(
            lambda x, y, s, dims=dims: jnp.concatenate([jnp.zeros((*s.shape, 2), jnp.float32), sobol(s)], -1)[
                ..., :dims
            ],
            dims,
        )
        with pytest.raises(ValueError, match=f"for strata of 512 samples: of the boxes {named} 512 have"):
            bake(later, (1, 1), 512, tuple(range(dims)), bits=8)
    # More samples than bits, but never more than one in an interval.
    centre = samplers.function(lambda x, y, s: 0.5 * np.ones((*s.shape, 2), np.float32), 2)
    assert np.all(bake(centre, (1, 1), 512, bits=8).values == 128)


def test_tables_are_made_in_pieces(monkeypatch):
    from qmcjax.bridges import _plain

    whole = bake(SAMPLER, TILE, SPP, DIMS).values
    monkeypatch.setattr(_plain, "PIECE", 3 * 6 * SPP * 5)
    assert np.array_equal(bake(SAMPLER, TILE, SPP, DIMS).values, whole)


def test_masks():
    mask = samplers.blue_noise_mask(2)
    table = bake_mask(mask)
    assert table.values.shape == (64, 64, 1, 2)
    assert np.array_equal(table.values[:, :, 0], np.floor(mask * 2**16))
    assert bake_mask(mask[..., 0], bits=24).values.dtype == np.float32


def test_orders():
    order = orders.optimized(64, 64, spp=4, key=2)
    table = bake_order(order)
    assert table.bits == 16 and table.values.dtype == np.uint16
    for position in (0, 1, 77, 4095):
        x, y = map(int, order.pixel(position))
        assert table.values[y, x, 0, 0] == position
    with pytest.raises(ValueError, match="table must contain coordinates to have points"):
        _ = table.points
    assert [bake_order(orders.raster(256, height)).bits for height in (1, 2, 256, 257)] == [8, 16, 16, 32]


def test_matrices():
    sequence = sequences.one_two(6)
    columns = bake_matrices(sequence).values[0, 0]
    index = np.random.default_rng(3).integers(0, 2**32, 20, np.uint32)
    chosen = np.where(index[:, None] >> np.arange(32, dtype=np.uint32) & 1, columns[:, None], 0)
    found = np.bitwise_xor.reduce(chosen.astype(np.uint32), axis=-1).T
    assert np.array_equal(found, sequence.bits(index))


@pytest.mark.parametrize("spp", [4, 64])
def test_ranked_keys(spp):
    sampler = samplers.ranked(3, key=5)
    keys, sequence = bake_ranked(sampler, spp)
    rng = np.random.default_rng(2)
    x, y, s = rng.integers(0, 200, 40), rng.integers(0, 200, 40), rng.integers(0, spp, 40)
    key = keys.values[y % 64, x % 64, 0]
    found = sequence.values[0, 0, s ^ key[:, 0]] ^ key[:, 1:]
    assert np.array_equal(found, np.asarray(sampler(x, y, s, (0, 1, 2), np.float64)) * 2**32 // 2**16)


test_wrong_arguments_are_named = refused(
    (lambda: bake(SAMPLER, (4096, 4096), 64), ValueError, "tile, spp and dims must make at most"),
    (lambda: bake_ranked(SAMPLER, 4), TypeError, "sampler must be one of samplers.ranked"),
    (lambda: bake(SAMPLER, (1, 1), 1).save("a.exr"), ValueError, "path must end in .npz or .h for bits=16"),
    (lambda: bake(SAMPLER, (1, 1), 1).save("a.x"), ValueError, "path must end in one of"),
    (lambda: bake(SAMPLER, (1, 1), 1).reader("hlsl"), ValueError, "language must be one of"),
    (lambda: bake(SAMPLER, (1, 1), 1, bits=32).reader("cpp"), ValueError, "bits must be one of"),
    (lambda: bake(SAMPLER, (1, 1), 1).reader("cpp", "a b"), ValueError, "name must be a name in C"),
)


def test_tables_print_what_they_are():
    assert isinstance(bake_order(orders.raster(2, 2)), BakedTable)
    assert "values" not in repr(bake_order(orders.raster(2, 2)))
