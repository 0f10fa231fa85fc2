"""Samplers, sequences, orders and scenes as source code: the same bits in every language."""

import ctypes
import platform
import re
from functools import partial

import compiled
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scene_tables
import shaders
import tables
import webgl

from qmcjax import orders, samplers, scenes, sequences
from qmcjax.bridges import source
from qmcjax.bridges._padding import padding_pair, padding_pixel

MANY, FEW = 2**16, 2**12
"""Random arguments: drivers of shaders without a graphics card take seconds for a million."""

WIDTHS = {"peano": 20}

KINDS = {"sampler": tables.SAMPLERS, "sequence": tables.SEQUENCES, "order": tables.ORDERS}
EVERY = [(kind, name) for kind, table in KINDS.items() for name in table]
OF_A_KIND = [(kind, name) for kind, name in EVERY if kind != "sequence" or name in tables.KINDS]
FEW_OF = {
    "sampler": "independent, owen; segments, hilbert, halton; ranked; randomized, contiguous, owen",
    "sequence": "sobol(9); owen_exact(sobol(2)); latin_hypercube(1601); owen(halton(3))",
    "order": "hilbert; scrambled_morton, tree",
}
SOME = [(kind, name) for kind, names in FEW_OF.items() for name in names.split("; ")]
"""Tables, loops, keys, and 64 bits."""


def made(kind, name):
    value = KINDS[kind][name]
    return value(WIDTHS.get(name, 16), 16) if kind == "order" else value


def drawn(kind, name, count):
    """Return an object, limits of its arguments, random ones, its number of results, and these."""
    value = made(kind, name)
    if kind == "order":
        limits = value.width, value.height
        given = webgl.drawn(count, limits)
        return value, limits, given, 1, np.asarray(value.position(*given))[:, None]
    limits = (value.limit,) if kind == "sequence" else value.fits.limits
    if name.startswith("randomized"):
        limits = (32, 32, 64)  # Each is of another pass: a sampler of its own.
    given, dims = webgl.drawn(count, limits), tuple(range(value.dims))
    # LLVM takes half of the time without optimisation.
    quick = partial(jax.jit, compiler_options={"xla_backend_optimization_level": 0})
    program = quick(lambda value, *given: value(*given, dims=dims))
    return value, limits, given, value.dims, np.asarray(program(value, *given))


def vectors(name):
    """Return a number of golden vectors: passes of an image do not know its size."""
    return 0 if name.startswith("randomized") else 16


def equal(found, expected):
    return np.array_equal(np.asarray(found).view(np.uint32), expected.view(np.uint32))


def missing(tool):
    return compiled.missing(tool) if tool in compiled.COMPILERS else shaders.missing(tool)


def in_shaders(language, kind, value, given, size, expected, folder, count):
    """Compare what a shader makes of arguments."""
    text = source(value, None, language, vectors=count)
    return equal(shaders.run(language, text, kind, given, size, folder), expected)


TOOLS = ("gcc", "clang", "rust", "cuda", "metal", "wgsl", "hlsl", *["slang"] * bool(shaders.slang()))
"""Compilers that are at hand: each of another language, or two of C. GLSL runs in WebGL."""


OF_SHADERS_TOO = ["gcc", "wgsl", "hlsl", *tables.slow("g++", "clang", *TOOLS[2:5], *TOOLS[7:])]


@pytest.mark.parametrize("tool", OF_SHADERS_TOO)
@pytest.mark.parametrize("kind, name", SOME, ids=[name for _, name in SOME])
def test_some_have_the_same_bits(kind, name, tool, tmp_path):
    if missing(tool):
        pytest.skip(missing(tool))
    value, _, given, size, expected = drawn(kind, name, FEW)
    if tool in compiled.COMPILERS:
        text = source(value, None, compiled.COMPILERS[tool][0], vectors=vectors(name))
        assert equal(compiled.run(tmp_path, text, kind, tool, given, size), expected)
    else:
        assert in_shaders(tool, kind, value, given, size, expected, tmp_path, vectors(name))


def test_entries_of_16_bits_are_unsigned_words(tmp_path):
    """C promotes them to int: a digit shifted to the first place would be a sign."""
    sampler = samplers.interleaved(sequences.halton(2, "faure"), 64, 16)
    given = webgl.drawn(FEW, (16, 16, 64))
    found = compiled.run(tmp_path, source(sampler), "sampler", "gcc", given, 2)
    assert equal(found, np.asarray(sampler(*given)))


PARTS = 8
"""Tests of objects of each kind, each of some: compilers start once for them."""


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_every_kind_of_object_has_the_same_bits(part, tmp_path):
    """At 2**16 random arguments, in all languages that a compiler is at hand for, and at golden vectors."""
    objects = {f"object{k}": OF_A_KIND[k] for k in range(part, len(OF_A_KIND), PARTS)}
    cases = {name: (kind, *drawn(kind, title, MANY)) for name, (kind, title) in objects.items()}
    without = {tool: missing(tool) for tool in TOOLS if missing(tool)}
    different = []
    for compiler in compiled.COMPILERS.keys() & set(TOOLS) - without.keys():
        language = compiled.COMPILERS[compiler][0]
        texts = {
            name: source(value, None, language, name, vectors=vectors(objects[name][1]))
            for name, (_, value, *_) in cases.items()
        }
        kinds = {name: (kind, size) for name, (kind, _, _, _, size, _) in cases.items()}
        lines = (compiled.driven(texts[k], kind, compiler, n, name=k) for k, (kind, n) in kinds.items())
        # With -O2 gcc takes nine seconds for 33 coordinates by ART.
        library = compiled.library(tmp_path, "\n".join(lines), compiler, ["-O1"])
        for name, (kind, _, _, given, size, expected) in cases.items():
            missed = getattr(library, f"checked_{name}")()
            if missed or not equal(compiled.called(library, kind, given, size, name), expected):
                different.append((compiler, *objects[name]))
    for language in set(TOOLS) - compiled.COMPILERS.keys() - without.keys():
        for name, (kind, value, _, *how) in cases.items():
            if not in_shaders(language, kind, value, *how, tmp_path, vectors(objects[name][1])):
                different.append((language, *objects[name]))
    assert not different
    if without:
        pytest.skip(f"the others agree: {without}")


ROW = """
void run_row(uint32_t count, uint32_t x, uint32_t y, uint32_t first, float *out) {
  mine_row(mine_prepare(x, y, mine_seeds), first, count, mine_seeds, out);
}
"""


@pytest.mark.skipif(bool(compiled.missing("gcc")), reason="no gcc")
@pytest.mark.parametrize("name", ["independent, owen", "ranked", *tables.slow("designed", "z, tree")])
def test_samples_in_rows_have_the_same_bits(name, tmp_path):
    """Many are computed at once, with the flags that the comment recommends."""
    sampler = tables.SAMPLERS[name]
    flags = ["-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math"]
    flags += ["-mprefer-vector-width=512"] * (platform.machine() == "x86_64")
    made = compiled.library(tmp_path, source(sampler, None) + ROW, "gcc", flags)
    first, count = 1, min(37, sampler.fits.spp - 1)
    out = np.zeros((sampler.dims, count), np.float32)
    made.run_row(*map(ctypes.c_uint32, (count, 3, 5, first)), out.ctypes.data_as(ctypes.c_void_p))
    samples = first + np.arange(count, dtype=np.uint32)
    expected = sampler(np.uint32(3), np.uint32(5), samples, tuple(range(sampler.dims)))
    assert equal(np.ascontiguousarray(out.T), np.asarray(expected))


class Swapped:
    """Swaps halves of a word, then bytes, ...: with all of these steps, it reverses the word."""

    dims = 1

    def __init__(self, *steps):
        self.steps = steps

    def __call__(self, x, y, sample, dims, dtype):
        word = sample * np.uint32(2654435769) + x
        word = (word << 16) | (word >> 16)
        for by, mask in self.steps:
            word = ((word & np.uint32(mask)) << by) | ((word >> by) & np.uint32(mask))
        return (word >> 8).astype(jnp.float32)[..., None] * np.float32(2**-24)


STEPS = ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))


OTHERS = STEPS[:3], STEPS[1:], (*STEPS[:3], (1, 0x55555554)), (*STEPS, (1, 0x55555555))


@pytest.mark.parametrize("steps", [STEPS, *OTHERS])
def test_reversals_of_all_bits_are_one_instruction(steps, tmp_path):
    """A missing step or another mask is computed as it stands; a further step follows a reversal."""
    sampler, whole = Swapped(*steps), STEPS == steps[:4]
    names = {"c": "qmcjax_reverse", "wgsl": "reverseBits", "hlsl": "reversebits", "cuda": "__brev"}
    for language, name in names.items():
        text = source(sampler, None, language)
        own = re.split(r"(?:void|fn) mine_(?:sample|pair)\(", text)[1]
        assert own.count(f"{name}(") == whole
    given = webgl.drawn(FEW, (16, 16, 2**31))
    expected = np.asarray(sampler(*given, (0,), jnp.float32))
    assert equal(compiled.run(tmp_path, source(sampler, None), "sampler", "gcc", given, 1), expected)


@pytest.mark.skipif(webgl.CHROMIUM is None, reason="no chromium (Debian: chromium)")
@pytest.mark.browser
@pytest.mark.parametrize("part", range(4))
def test_webgl_has_the_same_bits(part, tmp_path):
    """In few pages, since each starts a browser; all by their sum, golden vectors of short texts only."""
    cases, expected, checked = {}, {}, 0
    for kind, name in EVERY[part::4]:
        value, limits, _, size, found = drawn(kind, name, MANY)
        text = source(value, None, "glsl")
        if len(text) < 4000 and vectors(name):
            text = source(value, None, "glsl", vectors=vectors(name))
            checked += 1
        cases[name] = webgl.case(text, kind, MANY, limits, size)
        expected[name] = webgl.summed(found)
    sums = dict(zip(cases, webgl.run(tmp_path, list(cases.values())), strict=True))
    assert sums == expected, {name: sums[name] for name in sums if sums[name] != expected[name]}
    assert checked >= 5


ROUNDED = ("gaussian", "product", "genz", "zone_plate", "path_toy")
"""Scenes with functions that compilers round in their own ways, or a loop that XLA fuses."""


def users_scene(points):
    """Return a root inside a parabola, and steps outside."""
    x, y = points[..., 0], points[..., 1]
    return jnp.where(y > 4 * (x - 0.5) ** 2, jnp.sqrt(x * y), jnp.floor(8 * x) / (8 + y))


SCENES = {**scene_tables.EVERY, "a user's": scenes.function(users_scene, ("x", "y"))}


@pytest.fixture(scope="module")
def scenes_in_c(tmp_path_factory):
    """Return a library of all scenes, without products and sums that are fused."""
    if compiled.missing("gcc"):
        pytest.skip(compiled.missing("gcc"))
    texts = []
    for number, scene in enumerate(SCENES.values()):
        name = f"scene{number}"
        text = source(scene, name=name)
        texts.append(compiled.driven(text, "scene", "gcc", 1, len(scene.needs), name))
    return compiled.library(tmp_path_factory.mktemp("scenes"), "\n".join(texts), "gcc", ["-ffp-contract=off"])


@pytest.mark.parametrize("name", list(SCENES))
def test_scenes_are_exact_or_within_rounding(name, scenes_in_c):
    """All others have sums, products, quotients, roots, floors and comparisons, each rounded once."""
    scene, rng = SCENES[name], np.random.default_rng(7)
    points = rng.random((FEW, len(scene.needs)), np.float32)
    expected = np.asarray(scene(jnp.asarray(points)))
    made = f"scene{list(SCENES).index(name)}"
    found = compiled.called(scenes_in_c, "scene", [points], 1, made)[:, 0]
    if name.startswith(ROUNDED):
        assert np.max(np.abs(found - expected) / np.maximum(1, np.abs(expected))) < 8 * 2.0**-24
    else:
        assert np.array_equal(found, expected)


OWEN = samplers.independent(sequences.sobol(2), key=1)


def test_other_seeds_need_no_other_program(tmp_path):
    """The text without the seeds is the same for each key, and the seeds are arguments."""
    texts = [source(samplers.z(16, 16, 4, key), (0, 1)) for key in (1, 2)]
    seeds = re.compile(r"mine_seeds\[\d+\] = \{.*?\};", re.S)
    assert texts[0] != texts[1] and seeds.sub("", texts[0]) == seeds.sub("", texts[1])
    swapped = seeds.sub(seeds.search(texts[1])[0], texts[0])
    given = webgl.drawn(FEW, (16, 16, 4))
    expected = np.asarray(samplers.z(16, 16, 4, 2)(*given))
    assert equal(compiled.run(tmp_path, swapped, "sampler", "gcc", given, 2), expected)


@pytest.mark.parametrize("name", ["independent, owen", "ranked"])
def test_programs_for_an_image_are_shorter_with_the_same_bits(name, tmp_path):
    sampler = tables.SAMPLERS[name]
    width, height = 5, 7
    text = source(sampler, None, width=width, height=height, spp=3)
    assert f"// Arguments: x < {width}, y < {height}, s < 3." in text
    assert len(text) < len(source(sampler, None))
    grid = np.meshgrid(range(width), range(height), range(3))
    given = [np.ravel(axis).astype(np.uint32) for axis in grid]
    expected = np.asarray(sampler(*given, tuple(range(sampler.dims))))
    assert equal(compiled.run(tmp_path, text, "sampler", "gcc", given, sampler.dims), expected)


PAIRS = (
    "void run(uint32_t n, const uint32_t *x, const uint32_t *y, const uint32_t *s, const uint32_t *pair, "
    "float *out) {\n  for (uint32_t i = 0; i < n; i++) "
    "mine_pair(mine_prepare(x[i], y[i], mine_seeds), pair[i], s[i], mine_seeds, out + 2 * i);\n}"
)


def test_pairs_beyond_are_those_of_all_bridges(tmp_path):
    text = source(OWEN)
    rng = np.random.default_rng(7)
    x, y, s, pair = (rng.integers(0, 2**32, FEW, dtype=np.uint32) for _ in range(4))
    made = compiled.library(tmp_path, text + PAIRS, "gcc")
    found = np.zeros((FEW, 2), np.float32)
    made.run(FEW, *(array.ctypes.data_as(compiled.ctypes.c_void_p) for array in (x, y, s, pair, found)))
    known = re.search(r"mine_seeds\[\d+\] = \{(.*?)\};", text, re.S)[1]
    words = np.array([int(word.strip(" \nu")) for word in known.split(",")][-2:], np.uint32)
    pixel = padding_pixel(*map(jnp.asarray, (words, x, y)))
    assert equal(found, np.asarray(padding_pair(pixel, pair, s)))


def test_padded_pairs_are_nets_and_independent():
    """Every aligned block of 2**k samples is a (0,k,2)-net; no two pairs share their order, or a point."""
    sample = jnp.arange(64, dtype=jnp.uint32)
    pixel = padding_pixel(jnp.array([3, 4], jnp.uint32), jnp.uint32(5), jnp.uint32(6))
    pairs = [np.asarray(padding_pair(pixel, jnp.uint32(k), sample)) for k in range(200)]
    for points in pairs[:20]:
        for block in (points[:16], points[16:32], points):
            bits = (block.astype(np.float64) * 2**32).astype(np.uint32)
            assert tables.is_net(bits, len(block).bit_length() - 1)
    assert np.all(np.abs(np.mean(pairs, axis=1) - 0.5) < 2.0**-6)
    assert len(np.unique(np.argsort(np.array(pairs)[..., 0], axis=1), axis=0)) == len(pairs)
    # No pair repeats another's points, another key's or pixel's; halves of two pairs are not the same.
    y, x = jnp.indices((16, 16), jnp.uint32)[..., None, None]
    pixels = jnp.stack([padding_pixel(jnp.uint32([key, 4]), x, y) for key in (1 << 20, 1 << 24)])
    numbers = jnp.arange(1, 3, dtype=jnp.uint32).reshape(1, 1, 1, 2, 1)
    many = np.asarray(padding_pair(pixels, numbers, sample[:16].reshape(1, 1, 1, 1, 16)))
    assert many.shape[:-1] == (2, 16, 16, 2, 16)
    assert len(np.unique(many.reshape(-1, 2), axis=0)) == many.size // 2
    halves = many[..., 0] < 0.5
    same = (halves[..., 0, :] == halves[..., 1, :]).mean(axis=-1)
    assert ((same == 0) | (same == 1)).mean() < 0.05
    assert abs(np.mean(2 * same - 1)) < 5 / np.sqrt(15 * same.size)


def test_headers_say_what_and_how():
    text = source(samplers.independent(sequences.owen(sequences.sobol(4), 1), 3), (0, 3), name="ours")
    head = text[: text.index("#include")]
    assert "Independent(owen(sobol(dims=4)))" in head and "coordinates 0, 3" in head
    assert "ours_sample(pixel, s, ours_seeds, u)" in head and "in [0, 1)" in head
    assert "Copyright (c) 2008, Frances Y. Kuo and Stephen Joe" in head
    assert "Kuo" not in source(OWEN) and "s < 4" in source(samplers.z(16, 16, 4, 1))
    assert "ours_pixel" in text and "mine" not in text
    # Functions of two files go together.
    assert source(scenes.ball(), name="one") != source(scenes.ball(), name="two")


def test_users_samplers_are_translated(tmp_path):
    """Ten lines written this morning."""

    class Mine:
        dims = 2

        def __call__(self, x, y, sample, dims, dtype):
            index = orders.hilbert(16, 16).position(x, y) * np.uint32(4) + sample
            points = sequences.sobol(2)(index, dims, dtype)
            return jnp.minimum(points * np.float32(0.5) + np.float32(0.25), np.float32(0.75))

    given = webgl.drawn(FEW, (16, 16, 4))
    expected = np.asarray(Mine()(*given, (0, 1), jnp.float32))
    assert equal(compiled.run(tmp_path, source(Mine()), "sampler", "gcc", given, 2), expected)
