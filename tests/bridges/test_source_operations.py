"""Every operation of programs, of every dtype that has it, in every target: beside NumPy."""

import compiled
import numpy as np
import pytest
import shaders
import tables
from test_source_programs import evaluated

from qmcjax.bridges import mitsuba
from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._operations import COMPARISONS, FUNCTIONS, OPERATIONS
from qmcjax.bridges._source._program import BOOL, DOUBLE, DTYPES, FLOAT, LONG, UINT, ULONG, Value, schedule
from qmcjax.bridges._source._source import LANGUAGES
from qmcjax.bridges._source._writer import Writer
from qmcjax.bridges.mitsuba._evaluated import Arrays, Evaluated

COUNT = 61
"""Arguments of each kind: with all of them, some lanes of a processor divide by what is no argument."""

UNARY = {"not", "neg", "abs", "floor", "ceil", "round_even", "reverse", *FUNCTIONS} - {"atan2", "pow"}
CASES = [(kind, dtype, dtype) for kind in OPERATIONS for dtype in DTYPES if dtype.kind in OPERATIONS[kind]]
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
        one, other = (
            np.ascontiguousarray(words[rows(kind, dtype), columns]).view(UINT if made == BOOL else made)
            for words in (found, wanted)
        )
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


def text_of(program, language):
    writer = Writer(language, "mine", np.zeros(1, np.uint32))
    writer.fill("mine", program, (), ("x", "y", "s"), FLOAT)
    return writer.text("// All operations.")


@pytest.mark.parametrize("target", ["gcc", *tables.slow("cuda", "wgsl", "hlsl", "glsl")])
def test_languages_compute_what_numpy_does(target, tmp_path):
    of_c = target in compiled.COMPILERS
    if missing := (compiled if of_c else shaders).missing(target):
        pytest.skip(missing)
    cases = CASES if of_c else NARROW
    program, words = program_of(cases), given()
    size, language = len(program.outputs), LANGUAGES["c" if target == "gcc" else target]
    text = text_of(program, language)
    if of_c:
        flags = ["-O1", "-ffp-contract=off"]
        found = compiled.run(tmp_path, text, "sampler", target, words[1:], size, flags)
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
