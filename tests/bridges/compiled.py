"""Source code, compiled: functions of arrays in C, C++ and Rust; CUDA and Metal compiled as C++."""

import ctypes
import shutil
import subprocess

import numpy as np

COMPILERS = {
    "gcc": ("c", ["gcc", "-std=c99", "-pedantic"]),
    "g++": ("c", ["g++", "-std=c++11", "-x", "c++"]),
    "clang": ("c", ["clang", "-std=c99"]),
    "cuda": ("cuda", ["g++", "-std=c++11", "-x", "c++", "-D__device__=", "-include", "cuda.h"]),
    "metal": ("metal", ["g++", "-std=c++14", "-x", "c++", "-I.", "-Wno-unused-parameter"]),
    "rust": ("rust", ["rustc", "--edition=2018", "--crate-type=cdylib", "-Copt-level=1", "-Dwarnings"]),
}
"""Languages of ``source`` and commands; CUDA without its qualifiers, CUDA and Metal with functions of ours.

No compiler of Metal is at hand: the text is C++14 where ``METAL`` has what Metal adds to it.
"""

CUDA = """\
#include <math.h>
#include <string.h>
static inline float __uint_as_float(unsigned bits) { float f; memcpy(&f, &bits, 4); return f; }
static inline unsigned __brev(unsigned v) {
  unsigned r = 0;
  for (int k = 0; k < 32; k++) r |= (v >> k & 1u) << (31 - k);
  return r;
}
static inline unsigned __float_as_uint(float f) { unsigned bits; memcpy(&bits, &f, 4); return bits; }
static inline double __longlong_as_double(long long bits) { double f; memcpy(&f, &bits, 8); return f; }
static inline long long __double_as_longlong(double f) { long long bits; memcpy(&bits, &f, 8); return bits; }
"""

METAL = """\
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#define constant const
#define thread
typedef unsigned int uint;
template <class T, class U> T as_type(U value) {
  T bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}
namespace metal {
template <class T> T min(T a, T b) { return b < a ? b : a; }
template <class T> T max(T a, T b) { return a < b ? b : a; }
inline uint reverse_bits(uint v) {
  uint r = 0;
  for (int k = 0; k < 32; k++) r |= (v >> k & 1u) << (31 - k);
  return r;
}
using std::abs; using std::acos; using std::asin; using std::atan; using std::atan2; using std::ceil;
using std::cos; using std::exp; using std::exp2; using std::floor; using std::fmod; using std::log;
using std::log2; using std::pow; using std::rint; using std::sin; using std::sqrt; using std::tan;
using std::tanh;
}
"""

WARNINGS = ["-Wall", "-Wextra", "-Werror"]
FLAGS = ["-O2", *WARNINGS, "-shared", "-fPIC"]

WORDS = {"sampler": "xys", "sequence": "x", "order": "xy"}
"""Arguments of each kind of object."""

OF_C = """
{link}void run_{name}(uint32_t n, {parameters}, {kind} *out) {{
  for (uint32_t i = 0; i < n; i++) {call};
}}
{link}int checked_{name}(void) {{ return {check}; }}
"""
OF_RUST = """
#[no_mangle] pub unsafe extern "C" fn run_{name}(n: u32, {parameters}, out: *mut {kind}) {{
  for i in 0..n as usize {{ {call}; }}
}}
#[no_mangle] pub extern "C" fn checked_{name}() -> i32 {{ {check} }}
"""


def missing(compiler):
    """Return why a compiler cannot be used, or None."""
    command = COMPILERS[compiler][1][0]
    return None if shutil.which(command) else f"no {command}"


def library(folder, text, compiler, flags=()):
    """Return a shared library of some source code."""
    (folder / "cuda.h").write_text(CUDA)
    (folder / "metal_stdlib").write_text(METAL)
    (folder / "mine.c").write_text(text)
    made = folder / f"mine-{compiler}.so"
    first, *own = COMPILERS[compiler][1]
    if compiler != "rust":
        own = [*FLAGS, *own, *flags, "-lm"]
    command = [first, "-o", str(made), "mine.c", *own]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:4000]
    return ctypes.CDLL(str(made))


def driven(text, kind, compiler, size, inputs=0, name="mine"):
    """Return source code with a function that calls the function of a name for arrays, and its check."""
    language, command = COMPILERS[compiler]
    rust, seeds = language == "rust", [f"{name}_seeds"] * (f"{name}_seeds" in text)
    if rust:
        words = [f"*{letter}.add(i)" for letter in WORDS.get(kind, "")]
        words = words or [f"&*(p.add({inputs} * i) as *const [f32; {inputs}])"]
        call = f"{name}({', '.join([*words, *(f'&{each}' for each in seeds)])})"
        call = f"*out.add(i) = {call}" if kind == "order" else f"*(out as *mut [f32; {size}]).add(i) = {call}"
        parameters = [f"{letter}: *const u32" for letter in WORDS.get(kind, "")] or ["p: *const f32"]
    else:
        words = [f"{letter}[i]" for letter in WORDS.get(kind, "")] or [f"p + {inputs} * i"]
        place = f"(float (&)[{size}])out[{size} * i]" if language == "metal" else f"out + {size} * i"
        call = f"{name}({', '.join([*words, *seeds, *[place] * (kind != 'order')])})"
        call = f"out[i] = {call}" if kind == "order" else call
        parameters = [f"const uint32_t *{letter}" for letter in WORDS.get(kind, "")] or ["const float *p"]
    known = {"name": name, "call": call, "parameters": ", ".join(parameters)}
    known["link"] = 'extern "C" ' if "c++" in command else ""
    known["check"] = f"{name}_check()" if f"{name}_check" in text else "0"
    known["kind"] = ("u32" if rust else "uint32_t") if kind == "order" else "f32" if rust else "float"
    return text + (OF_RUST if rust else OF_C).format(**known)


def called(made, kind, inputs, size, name="mine"):
    """Return what a function of a library makes of arrays, shape (n, size)."""
    out = np.zeros((len(inputs[0]), size), np.uint32 if kind == "order" else np.float32)
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (*inputs, out)]
    getattr(made, f"run_{name}")(ctypes.c_uint32(len(inputs[0])), *pointers)
    return out


def run(folder, text, kind, compiler, inputs, size, flags=()):
    """Return what the function ``mine`` makes of arrays, shape (n, size); it misses no golden vector."""
    made = library(folder, driven(text, kind, compiler, size), compiler, flags)
    assert made.checked_mine() == 0
    return called(made, kind, inputs, size)
