"""Every operation of programs, of every dtype that has it, in every target: beside NumPy."""

import compiled
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import shaders
import tables
from test_source_programs import evaluated

from qmcjax import samplers, scenes
from qmcjax.bridges import mitsuba, source
from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._operations import COMPARISONS, FUNCTIONS, OPERATIONS
from qmcjax.bridges._source._program import BOOL, DOUBLE, DTYPES, FLOAT, LONG, UINT, ULONG, Value, schedule
from qmcjax.bridges._source._source import LANGUAGES
from qmcjax.bridges._source._writer import Writer
from qmcjax.bridges.mitsuba._evaluated import Arrays, Evaluated

COUNT = 61
"""Arguments of each kind: with all of them, some lanes of a processor divide by what is no argument."""

UNARY = {"not", "neg", "abs", "floor", "ceil", "round_even", "reverse", *FUNCTIONS} - {"atan2", "pow"}
CASES = [(kind, of, of) for kind, row in OPERATIONS.items() for of in DTYPES if of.kind in row.kinds]
CASES.remove(("reverse", ULONG, ULONG))
CASES += [("select", dtype, dtype) for dtype in DTYPES]
CASES += [("convert", of, to) for of in DTYPES for to in DTYPES if of != to]
CASES += [("bitcast", *each) for each in ((UINT, FLOAT), (FLOAT, UINT), (ULONG, DOUBLE), (DOUBLE, LONG))]
NARROW = [case for case in CASES if all(dtype.itemsize <= 4 for dtype in case[1:])]


def given():
    """Return four words each: zeros, and two integers or float32 and a word, or a float64 and a float32.

    Integers have all sizes; floats are a few units, halves too, and then below 1 and positive.
    """
    rng = np.random.default_rng(7)
    words = rng.integers(0, 2**32, (3, COUNT), np.uint32) >> rng.integers(0, 32, (3, COUNT), np.uint32)
    words[1, ::4] = words[0, ::4]
    a, b = rng.uniform(-9, 9, (2, COUNT))
    a[:8] = np.arange(8) / 2 - 2
    b = b.astype(np.float32).view(np.uint32)
    sets = [words]
    sets += [np.stack([each.astype(np.float32).view(np.uint32), b, b]) for each in (a, abs(a) / 10 + 0.05)]
    for each in (a, abs(a) / 10 + 0.05):
        sets.append(np.stack([(each.view(np.uint64) >> 32).astype(np.uint32), each.view(np.uint32)[::2], b]))
    return [np.zeros(5 * COUNT, np.uint32), *np.concatenate(sets, axis=1)]


def rows(kind, dtype):
    """Return the places of words that are arguments of an operation."""
    first = {FLOAT: 1, DOUBLE: 3}.get(dtype, 0)
    return slice((first + (kind in FUNCTIONS)) * COUNT, (first + 2) * COUNT if first else None)


def result(builder, case, x, y, s):
    kind, dtype, made = case
    if dtype.itemsize == 8:
        a = builder.bitcast(builder.convert(x, ULONG) << 32 | builder.convert(y, ULONG), dtype)
        b = builder.convert(builder.bitcast(s, FLOAT) if dtype == DOUBLE else s, dtype)
    elif dtype == BOOL:
        a, b = (builder.convert(word & 1, BOOL) for word in (x, y))
    else:
        a, b = (builder.bitcast(word, dtype) for word in (x, y))
    if kind in ("convert", "bitcast"):
        return getattr(builder, kind)(a, made)
    if dtype.kind in "iu" and kind.startswith("shift"):
        b = b & 8 * dtype.itemsize - 1
    elif dtype.kind in "iu" and kind in ("div", "rem"):
        b = builder.load(np.arange(-15, 17, 2).astype(dtype), y & 15)
    return builder.select(a < b, a, b) if kind == "select" else a.apply(kind, *[b] * (kind not in UNARY))


def program_of(cases):
    """Return a program of four words whose outputs are the words of results, their bits as float32."""
    builder, words = Builder(), []
    inputs = [builder.input(k, UINT) for k in range(4)]
    for case in cases:
        value = result(builder, case, *inputs[1:])
        if value.dtype.itemsize == 8:
            bits = builder.bitcast(value, ULONG)
            words += [builder.convert(bits, UINT), builder.convert(bits >> 32, UINT)]
        else:
            words.append((builder.convert if value.dtype == BOOL else builder.bitcast)(value, UINT))
    return schedule(inputs, [builder.bitcast(word, FLOAT) for word in words])


def differing(cases, program, found, rounding):
    """Return the cases with other numbers than NumPy's, beyond rounding of functions and quotients."""
    wanted, different, at = np.transpose(evaluated(program, *given())), [], 0
    for kind, dtype, made in cases:
        made = BOOL if kind in COMPARISONS else made
        columns = slice(at, at := at + max(made.itemsize // 4, 1))
        parts = (np.ascontiguousarray(words[rows(kind, dtype), columns]) for words in (found, wanted))
        one, other = (part.view(UINT if made == BOOL else made) for part in parts)
        if made.kind == "f" and kind in (*FUNCTIONS, *rounding):
            within = rounding.get(kind, rounding["functions"]) * np.finfo(made).eps
            same = np.all(abs(one - other) <= within * np.maximum(1, abs(other)))
        else:
            same = np.array_equal(one, other, equal_nan=made.kind == "f")
        if not same:
            different.append((kind, str(dtype), str(made)))
    return different


ROUNDING = {"functions": 16, "rem": 0}
OF_SHADERS = {"functions": 2**13, "div": 4, "rem": 8}
"""In units of the last place, beside 1 for small results."""


TARGETS = ("rust", "cuda", "metal", "wgsl", "hlsl", "glsl", *["slang"] * bool(shaders.slang()))


def text_of(program, language):
    writer = Writer(language, "mine", np.zeros(1, np.uint32))
    writer.fill("mine", program, (), ("x", "y", "s"), FLOAT)
    return writer.text("// All operations.")


@pytest.mark.parametrize("target", ["gcc", *tables.slow(*TARGETS)])
def test_languages_compute_what_numpy_does(target, tmp_path):
    of_c = target in compiled.COMPILERS
    if missing := (compiled if of_c else shaders).missing(target):
        pytest.skip(missing)
    language = LANGUAGES["c" if target == "gcc" else target]
    cases = CASES if language.has_64 else NARROW
    program, words = program_of(cases), given()
    size = len(program.outputs)
    text = text_of(program, language)
    if of_c:
        how = ["-O1", "-ffp-contract=off"]
        found = compiled.run(tmp_path, text, "sampler", target, words[1:], size, how)
    else:
        found = shaders.run(target, text, "sampler", words[1:], size, tmp_path)
    assert not differing(cases, program, found, ROUNDING if of_c else OF_SHADERS)


@pytest.mark.parametrize("target", ["scalar", *tables.slow("llvm")])
def test_dr_jit_computes_what_numpy_does(target):
    drjit = pytest.importorskip("drjit")
    if target == "llvm":
        try:
            mitsuba.check_llvm()
        except RuntimeError as error:
            pytest.skip(str(error))
    program = program_of(CASES)
    arrays = Arrays(drjit, drjit.scalar.ArrayXf if target == "scalar" else drjit.llvm.Float)
    found = Evaluated(arrays, program, {})([arrays.uint(words) for words in given()])
    # An output that is a constant has one entry.
    found = np.stack([np.broadcast_to(np.array(words), 5 * COUNT) for words in found], axis=-1)
    assert not differing(CASES, program, found, ROUNDING)


def test_operations_are_listed_for_each_target():
    """And one that is not is an error, even if Dr.Jit or a language has a function of its name."""
    drjit, number = pytest.importorskip("drjit"), Builder().input(0, FLOAT)
    unlisted = Value("sinh", FLOAT, (number,))
    for language in LANGUAGES.values():
        assert text_of(program_of(CASES if language.has_64 else NARROW), language)
        with pytest.raises(KeyError, match="sinh"):
            language.operation(unlisted, "a")
    with pytest.raises(KeyError, match="sinh"):
        Arrays(drjit, drjit.scalar.ArrayXf).operation(unlisted)
    with pytest.raises(KeyError, match="sinh"):
        number.apply("sinh")


SPECIAL = [np.nan, np.inf, -np.inf, 0, -0.0, -0.5, 127.5, 128, 255.9, 256, -128.9, -129, 65535.5, 1e10, -1e10]
SPECIAL += [sign * 2.0**power for sign in (1, -1) for power in (31, 32, 63, 64, 99)]
INTEGERS = [np.dtype(f"{kind}int{bits}") for kind in ("", "u") for bits in (8, 16, 32, 64)]


def floats(count=2**16):
    """Return words whose bits are floats of all sizes that are not subnormal, which XLA takes for 0."""
    words = np.random.default_rng(7).integers(0, 2**32, count, dtype=np.uint32)
    made = words.view(np.float32)
    made[: count // 2] = np.where(words[: count // 2] & 1, 1, -1) * 10.0 ** np.linspace(-3, 20, count // 2)
    made[: len(SPECIAL)] = SPECIAL
    return np.where(np.abs(made) < np.finfo(np.float32).tiny, np.float32(1), made).view(np.uint32)


def of_bits(word):
    return jax.lax.bitcast_convert_type(word, jnp.float32)


def converted(dtype, wide):
    def points(x, y, sample):
        with jax.enable_x64(True):
            value = of_bits(x).astype(jnp.float64) * 1.0000001 if wide else of_bits(x)
            made = value.astype(dtype).astype(jnp.uint64)
            return of_bits(jnp.stack([made.astype(jnp.uint32), (made >> 32).astype(jnp.uint32)]))

    return points


def clipped(value):
    return of_bits(jnp.clip(value, 2, 5).astype(jnp.uint32))


def in_range(function):
    """Return a function of numbers that are neither infinite nor NaN."""
    return lambda x, y, sample: function(*(word.astype(jnp.float32) for word in (x, y)))


def wide(x, y, sample):
    """Divide in float64 by constants, and return the two words of the result."""
    with jax.enable_x64(True):
        root = jnp.sqrt(x.astype(jnp.float64) / 7) / 11
        bits = jax.lax.bitcast_convert_type(root, jnp.uint64)
        return of_bits(jnp.stack([bits.astype(jnp.uint32), (bits >> 32).astype(jnp.uint32)]))


SHARED = ("by a sum", "by one entry") * (jax.__version_info__ < (0, 10, 2))
"""Quotients by a number for several others: older versions divide."""
FLOATS = {
    **{f"{dtype} of float{32 + 32 * wide}": converted(dtype, wide) for dtype in INTEGERS for wide in (0, 1)},
    "clip": lambda x, y, s: jnp.stack([clipped(of_bits(x)), jnp.clip(of_bits(y), -3, 4)]),
    "min, max": lambda x, y, s: jnp.stack([f(*map(of_bits, (x, y))) for f in (jnp.minimum, jnp.maximum)]),
    "root of a quotient": in_range(lambda x, y: jnp.sqrt(jnp.stack([x, y]) / 7)),
    "by constants": in_range(lambda x, y: jnp.stack([x, y]) / np.array([3, 11], np.float32)),
    "by a sum": in_range(lambda x, y: jnp.stack([x, y]) / jnp.sum(jnp.stack([x, y]), keepdims=True)),
    "by one entry": in_range(lambda x, y: jnp.stack([x, y]) / jnp.maximum(x, 1)),
    "by another": in_range(lambda x, y: jnp.stack([x / jnp.maximum(y, 1), 7 / jnp.maximum(x, 1)])),
    "in float64": wide,
    "complements": lambda x, y, s: of_bits(jnp.stack([jnp.where(x < y, ~x, x), jnp.where(x < y, y, ~y)])),
}


@pytest.mark.skipif(compiled.missing("gcc") is not None, reason="no gcc")
def test_floats_have_the_bits_of_xla(tmp_path):
    """All in one program, with two results of each function."""

    def points(x, y, sample):
        return jnp.concatenate([function(x, y, sample) for function in FLOATS.values()])

    x, size = floats(), 2 * len(FLOATS)
    y = np.random.default_rng(8).permutation(x)
    expected = np.asarray(jax.jit(jax.vmap(points))(x, y, x))
    text, flags = source(samplers.function(points, size), None), ["-ffp-contract=off"]
    found = compiled.run(tmp_path, text, "sampler", "gcc", [x, y, x], size, flags)
    same = found.view(np.uint32) == expected.view(np.uint32)
    nan = np.isnan(found) & np.isnan(expected)  # It has many bits.
    off = {}
    for k, title in enumerate(FLOATS):
        equal = same | nan if title in ("clip", "min, max") else same
        off[title] = 1 - np.mean(equal[:, 2 * k : 2 * k + 2])
    assert not {title: share for title, share in off.items() if share and title not in SHARED}


def rounded_down(more):
    """Return a function that adds a number to words in float64, and rounds down."""

    def points(x, y, s):
        with jax.enable_x64(True):
            made = (x.astype(jnp.float64) + more).astype(jnp.uint32)
        return of_bits(jnp.stack([made, made]))

    return points


def test_conversions_of_what_is_in_range_cost_nothing():
    def cell(point):
        return jnp.floor(jnp.abs(jnp.sin(point[..., 0]))).astype(jnp.int32).astype(jnp.float32)

    def text(points):
        return source(samplers.function(points, 2)).partition("#include")[2].split("_pair(")[0]

    unknown = source(scenes.function(cell, ("x", "y")))
    assert "2147483647" in unknown and "!=" in unknown

    def ninths(x, y, s):
        return ((x >> 8).astype(jnp.float32) * 2**-24 * 9).astype(jnp.int32) / 9 + jnp.zeros(2)

    for each in (text(ninths), text(rounded_down(0.9))):
        assert "2147483" not in each and "!=" not in each and "?" not in each
    assert "?" in text(rounded_down(1.0))
