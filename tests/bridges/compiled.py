"""Source code, compiled: functions of arrays in C, C++ and CUDA compiled as C++."""

import ctypes
import shutil
import subprocess

import numpy as np

COMPILERS = {
    "gcc": ("c", ["gcc", "-std=c99", "-pedantic"]),
    "g++": ("c", ["g++", "-std=c++11", "-x", "c++"]),
    "clang": ("c", ["clang", "-std=c99"]),
    "cuda": ("cuda", ["g++", "-std=c++11", "-x", "c++", "-D__device__=", "-include", "cuda.h"]),
}
"""Languages of ``source`` and commands; CUDA without its qualifiers, and with functions of its own."""

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

FLAGS = ["-O2", "-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-shared", "-fPIC"]

DRIVERS = {
    "sampler": "void run_{name}(uint32_t n, const uint32_t *x, const uint32_t *y, const uint32_t *s, "
    "float *out) {\n"
    "  for (uint32_t i = 0; i < n; i++) {name}(x[i], y[i], s[i], {name}_seeds, out + {size} * i);\n}",
    "sequence": "void run_{name}(uint32_t n, const uint32_t *x, float *out) {\n"
    "  for (uint32_t i = 0; i < n; i++) {name}(x[i], {seeds}out + {size} * i);\n}",
    "order": "void run_{name}(uint32_t n, const uint32_t *x, const uint32_t *y, uint32_t *out) {\n"
    "  for (uint32_t i = 0; i < n; i++) out[i] = {name}(x[i], y[i]{seeds});\n}",
    "scene": "void run_{name}(uint32_t n, const float *p, float *out) {\n"
    "  for (uint32_t i = 0; i < n; i++) {name}(p + {inputs} * i, out + {size} * i);\n}",
}


def missing(compiler):
    """Return why a compiler cannot be used, or None."""
    command = COMPILERS[compiler][1][0]
    return None if shutil.which(command) else f"no {command}"


def library(folder, text, compiler, flags=()):
    """Return a shared library of some source code."""
    (folder / "cuda.h").write_text(CUDA)
    (folder / "mine.c").write_text(text)
    made = folder / f"mine-{compiler}.so"
    command = [*COMPILERS[compiler][1], *FLAGS, *flags, "-o", str(made), "mine.c", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:4000]
    return ctypes.CDLL(str(made))


def driven(text, kind, compiler, size, inputs=0, name="mine"):
    """Return source code with a function that calls the function of a name for arrays."""
    seeds = f"{name}_seeds" if f"{name}_seeds" in text else ""
    after = {"sequence": f"{seeds}, " if seeds else "", "order": f", {seeds}" if seeds else ""}.get(kind, "")
    driver = DRIVERS[kind]
    for word, value in (("name", name), ("size", size), ("inputs", inputs), ("seeds", after)):
        driver = driver.replace(f"{{{word}}}", str(value))
    link = 'extern "C" ' if COMPILERS[compiler][1][0].endswith("++") else ""
    return f"{text}\n{link}{driver}\n"


def called(made, kind, inputs, size, name="mine"):
    """Return what a function of a library makes of arrays, shape (n, size)."""
    out = np.zeros((len(inputs[0]), size), np.uint32 if kind == "order" else np.float32)
    pointers = [array.ctypes.data_as(ctypes.c_void_p) for array in (*inputs, out)]
    getattr(made, f"run_{name}")(ctypes.c_uint32(len(inputs[0])), *pointers)
    return out


def run(folder, text, kind, compiler, inputs, size, flags=()):
    """Return what the function ``mine`` makes of arrays, shape (n, size)."""
    made = library(folder, driven(text, kind, compiler, size), compiler, flags)
    return called(made, kind, inputs, size)
