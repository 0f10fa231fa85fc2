"""Samplers and arguments that cannot become source code: errors that name the line and what to do."""

import importlib
import inspect
import re
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from qmcjax import orders, samplers, scenes, sequences
from qmcjax.bridges import source
from qmcjax.bridges._source._reserved import reserving

OWEN = samplers.independent(sequences.sobol(2), key=1)
Z = samplers.z(16, 16, 4, key=1)


class Points:
    """A sampler with one coordinate too many."""

    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return jnp.zeros(3, dtype)


test_wrong_arguments_are_named = refused(
    (lambda: source(3), TypeError, "sampler must be a sampler, a sequence, an order or a scene"),
    (lambda: source(samplers.Sampler), TypeError, "a sampler, a sequence, an order or a scene"),
    (lambda: source(OWEN, name="a__b"), ValueError, "name must be an identifier .* underscores.*'a__b'"),
    (lambda: source(Points()), ValueError, r"must return points of shape \(2,\) .* got float32 \(3,\)"),
    (lambda: source(orders.morton3(4, 4, 2)), TypeError, r"sampler must be an order of pixels, .*at_frame"),
    (lambda: source(Z, width=32, height=16), ValueError, "width, height must be .* 16 x 16, got 32 x 16"),
    (lambda: source(Z, width=16), ValueError, "width and height must be given together"),
    (lambda: source(Z, spp=5), ValueError, "spp must be at most 4"),
    (lambda: source(Z, width=16, height=16, spp=8), ValueError, "spp must be at most 4"),
    (lambda: source(scenes.disc(), spp=4), ValueError, "spp must be None, except for samplers"),
    (lambda: source(orders.hilbert(4, 4), width=4), ValueError, "width must be None, except for samplers"),
)

WORDS_OF = {
    "C": "float restrict nullptr typeof main",
    "C++": "not_eq decltype co_await char8_t reinterpret_cast xor typeid final std",
    "CUDA": "float4 make_int2 threadIdx rsqrtf longlong3 atomicAdd half2 cudaMalloc warpSize norm3df",
    "GLSL": "buffer shared filter input output vec3 dmat3x2 usampler2DArray gl_FragCoord texelFetch mod",
    "WGSL": "type self set from fn i32 bitcast vec2f mat4x3h macro_rules yield Self storageBarrier select",
    "HLSL": "matrix pass int3x4 min16float2 RWStructuredBuffer saturate asuint groupshared Texture2DMS lerp",
}
RESERVED = [(language, word) for language, words in WORDS_OF.items() for word in words.split()]
MESSAGE = "name must not be a reserved word of (.*, )?{}, .*got '{}'"
test_words_of_languages_are_refused = refused(
    *((word, MESSAGE.format(re.escape(language), word)) for language, word in RESERVED),
    call=lambda name: source(OWEN, name=name),
    error=ValueError,
)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize("dialect", ["c99", "gnu17"])
def test_names_of_the_headers_of_c_are_refused(dialect):
    """All that gcc's headers define or declare, with the extensions of the C library."""
    head = "#include <math.h>\n#include <stdint.h>\n#include <string.h>\n"
    how = {"input": head, "capture_output": True, "text": True, "check": True}
    command = ["gcc", f"-std={dialect}", "-D_GNU_SOURCE", "-E", "-x", "c", "-"]
    texts = [subprocess.run([*command, flag], **how).stdout for flag in ("-dM", "-P")]
    names = set(re.findall(r"#define ([A-Za-z]\w*)", texts[0]))
    names |= set(re.findall(r"\b([A-Za-z]\w*) *\(", texts[1])) | set(re.findall(r"(\w+);", texts[1]))
    names = {name for name in names if name[0].isalpha() and "__" not in name}
    assert len(names) > 300 and not [name for name in names if "C" not in reserving(name)]


# Functions of users. Each line that is at fault ends with a comment, by which the test finds it.


def calls_numpy(x, y, sample):
    return jnp.stack([np.sqrt(x.astype(jnp.float32)) * 0, y])  # here


def branches(x, y, sample):
    half = 0.25 if x > 3 else 0.5  # here
    return jnp.full((2,), half, jnp.float32)


def becomes_an_integer(x, y, sample):
    return jnp.full((2,), 1 / int(x), jnp.float32)  # here


def indexes_a_list(x, y, sample):
    return jnp.full((2,), [0.25, 0.5][x], jnp.float32)  # here


def selects_by_a_mask(x, y, sample):
    both = jnp.stack([x, y])
    return both[both > np.uint32(3)].astype(jnp.float32)  # here


def finds_places(x, y, sample):
    return jnp.zeros(2, jnp.float32) + jnp.nonzero(jnp.stack([x, y]))[0].sum()  # here


def calls_back(x, y, sample):
    shape = jax.ShapeDtypeStruct((2,), np.float32)
    return jax.pure_callback(lambda s: np.zeros(2, np.float32), shape, sample)  # here


def sorts(x, y, sample):
    return jnp.sort(jnp.stack([x, y])).astype(jnp.float32)  # here


def sorts_as_well(x, y, sample):
    """Sort what has the shape of the one above: JAX traces its own function once, there."""
    return jnp.sort(jnp.stack([y, x])).astype(jnp.float32)  # here


@jax.jit
def own_function(x, y):
    return jnp.stack([x, y]).astype(jnp.float32).at[jnp.argmax(x)].get()  # here


def calls_a_compiled_function(x, y, sample):
    return jnp.full((2,), own_function(x, y))


def of_other_keys(x, y, sample):
    key = jax.random.key(3, impl="rbg")
    return jax.random.uniform(jax.random.fold_in(key, x), (2,))  # here


def of_other_words(x, y, sample):
    with jax.threefry_partitionable(False):
        return jax.random.uniform(jax.random.fold_in(jax.random.key(3), x), (2,))  # here


def of_many_values(x, y, sample):
    many = x + jnp.arange(5000, dtype=jnp.uint32)  # here
    return many[:2].astype(jnp.float32)


def stacks_in_a_loop(x, y, sample):
    _, rows = jax.lax.scan(lambda a, b: (a + b, a ^ b), x, jnp.arange(2000, dtype=jnp.uint32))  # here
    return rows[:2].astype(jnp.float32)


WORDS = {
    calls_numpy: "calls NumPy on a value that varies: use jax.numpy",
    branches: "branches on a value that varies: use jax.numpy.where",
    becomes_an_integer: "must not depend on values",
    indexes_a_list: "as a Python integer: use jax.numpy",
    selects_by_a_mask: "has a shape that depends on values",
    finds_places: "shapes, must not depend on values",
    calls_back: "'pure_callback' (it calls Python: write the function with jax.numpy",
    sorts: "'sort' (sort constants with NumPy",
    sorts_as_well: "'sort' (sort constants with NumPy",
    own_function: "'argmax' (sort constants with NumPy",
    of_other_keys: "use the generator threefry2x32",
    of_other_words: "'random_bits' (without jax_threefry_partitionable)",
    of_many_values: "more than 4096 values",
    stacks_in_a_loop: "a loop that stacks 2000 results",
}


@pytest.mark.parametrize("function", list(WORDS), ids=lambda function: function.__name__)
def test_untranslatable_samplers_are_told_their_line(function):
    """The line of their own file, also where JAX kept a library's function from another caller."""
    lines, first = inspect.getsourcelines(getattr(function, "__wrapped__", function))
    at_fault = next(first + number for number, line in enumerate(lines) if line.endswith("# here\n"))
    sampler = samplers.function(calls_a_compiled_function if function is own_function else function, 2)
    with pytest.raises(ValueError) as raised:
        source(sampler)
    said = str(raised.value)
    assert said.startswith("sampler ") and WORDS[function] in said, said
    assert f"at {__file__}:{at_fault} ({function.__name__})" in said, said


def test_flags_of_the_caller_change_no_words():
    sampler = samplers.randomized(lambda key: samplers.independent(sequences.sobol(2), key), 0, 4)
    before = source(sampler)
    with jax.threefry_partitionable(False):
        assert source(sampler) == before


def wide_sine(x, y, sample):
    with jax.enable_x64(True):
        return jnp.stack([jnp.sin(x.astype(jnp.float64)).astype(jnp.float32)] * 2)


def signed_and_wide(x, y, sample):
    with jax.enable_x64(True):
        return jnp.stack([(x.astype(jnp.int64) * -3 >> 2).astype(jnp.float32)] * 2)


@pytest.mark.parametrize(
    ("function", "words"), [(wide_sine, "sin of float64"), (signed_and_wide, "convert of uint32 to int64")]
)
def test_shaders_have_32_bits(function, words):
    sampler, place = samplers.function(function, 2), rf"test_untranslatable.py:\d+ \({function.__name__}"
    assert "double" in source(sampler) or "int64_t" in source(sampler)
    with pytest.raises(ValueError, match=f"language must be 'c' or 'cuda' for {words} at .*{place}"):
        source(sampler, language="glsl")


def test_errors_of_users_stay_what_they_are():
    def raises(x, y, sample):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        source(samplers.function(raises, 2))


LIBRARY = """
import jax.numpy as jnp

def sorts(x, y):
    return jnp.sort(jnp.stack([x, y])).astype(jnp.float32)
"""


def test_lines_of_installed_packages_are_those_of_their_callers(tmp_path, monkeypatch):
    packages = tmp_path / "lib" / "site-packages"
    packages.mkdir(parents=True)
    (packages / "installed.py").write_text(LIBRARY)
    monkeypatch.syspath_prepend(packages)
    installed = importlib.import_module("installed")

    def of_mine(x, y, sample):
        return installed.sorts(x, y)

    for function in (of_mine, lambda x, y, sample: installed.sorts(x, y) * 2):
        line = function.__code__.co_firstlineno + (function is of_mine)
        with pytest.raises(ValueError, match=re.escape(f"{__file__}:{line} ({function.__qualname__})")):
            source(samplers.function(function, 2))
