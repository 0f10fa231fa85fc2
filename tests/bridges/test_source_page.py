"""The pages of the documentation on source code: calls compile, and that in C prints what it says."""

import re
import shutil
import subprocess
import textwrap
from pathlib import Path

import numpy as np
import pytest
import shaders

from qmcjax.bridges import source

FOLDER = Path(__file__).parents[2] / "figures" / "docs" / "bridges"
PAGE, RENDERERS = ((FOLDER / name).read_text(encoding="utf-8") for name in ("source.rst", "renderers.rst"))

DEVICE = """\
#define __device__ __attribute__((device))
#define __global__ __attribute__((global))
struct Place { unsigned x, y, z; };
extern __device__ const Place threadIdx, blockIdx, blockDim;
__device__ float __uint_as_float(unsigned bits);
__device__ unsigned __float_as_uint(float value);
__device__ unsigned __brev(unsigned word);
"""
"""What clang needs of CUDA's headers."""


def block(directive, page=PAGE):
    """Return the first block of a directive on a page."""
    found = re.search(rf"\.\. {re.escape(directive)}\n\n((?: {{3}}.*\n|\n)+)", page)
    return textwrap.dedent(found[1])


@pytest.fixture(scope="module")
def sampler():
    """Return the sampler of the page."""
    names = {}
    exec(block("run::"), names)
    return names["sampler"]


def run(folder, *command):
    if not shutil.which(command[0]):
        pytest.skip(f"no {command[0]}")
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("compiler", ["gcc -std=c99", "g++ -x c++"])
def test_c_prints_the_points(sampler, compiler, tmp_path):
    (tmp_path / "mine.h").write_text(source(sampler))
    (tmp_path / "main.c").write_text(block("code-block:: c"))
    flags = ("-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-o", "main")
    run(tmp_path, *compiler.split(), *flags, "main.c", "-lm")
    printed = np.array(run(tmp_path, str(tmp_path / "main")).split(), np.float32).reshape(16, 2)
    s = np.arange(16, dtype=np.uint32)
    x, y = np.full_like(s, 10), np.full_like(s, 20)
    assert np.array_equal(printed, sampler(x, y, s))


OPTIONS = {
    "glsl": ("glslangValidator", "-S", "frag"),
    "hlsl": ("glslangValidator", "-D", "-V", "-S", "comp", "-e", "main", "--amb"),
    "cuda": (
        *("clang", "-x", "cuda", "--cuda-device-only", "--cuda-gpu-arch=sm_70", "-nocudainc", "-nocudalib"),
        *("-fsyntax-only", "-include", "device.h"),
    ),
}


@pytest.mark.parametrize("language", OPTIONS)
def test_it_compiles(sampler, language, tmp_path):
    text, user = source(sampler, language=language), block(f"code-block:: {language}")
    head, rest = user.rpartition('#include "mine.glsl"')[::2]
    (tmp_path / "mine").write_text(head + text + rest)
    (tmp_path / "device.h").write_text(DEVICE)
    run(tmp_path, *OPTIONS[language], "mine")


def test_wgsl_compiles(sampler):
    device = shaders.device()
    if isinstance(device, str):
        pytest.skip(device)
    code = f"{source(sampler, language='wgsl')}{block('code-block:: wgsl')}"
    module = device.create_shader_module(code=code)
    device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})


LOOP = """
static float at[2];
static int left;
static void path_begin(float x, float y) { at[0] = x; at[1] = y; left = 2; }
static int path_continues(void) { return left-- > 0; }
static float path_bounce(float u, float v) { return at[0] + at[1] + u + v; }
@TEXT@
int main(void) {
    float image[12];
    render(4, 3, 16, image);
    for (int k = 0; k < 12; k++) printf("%.9g\\n", image[k]);
    return mine_check();
}
"""
PBRT = """
#include <cstdio>
typedef float Float;
struct Point2i { int x, y; };
struct Point2f { Point2f(float a, float b) : x(a), y(b) {} float x, y; };
@TEXT@
int main() {
    MineSampler sampler;
    for (int s = 0; s < 16; s++) {
        sampler.StartPixelSample(Point2i{3, 5}, s, 0);
        const Point2f first = sampler.GetPixel2D(), second = sampler.Get2D();
        std::printf("%.9g %.9g %d\\n", first.x, first.y, second.x != first.x);
    }
    return mine_check();
}
"""


@pytest.fixture(scope="module")
def shipped():
    """Return the sampler and the text of the page on renderers."""
    names = {}
    exec(block("run::", RENDERERS), names)
    return names["sampler"], names["text"]


def test_a_loop_of_paths_runs(shipped, tmp_path):
    sampler, text = shipped
    (tmp_path / "mine.h").write_text(text)
    code = "#include <stdio.h>" + LOOP.replace("@TEXT@", block("code-block:: c", RENDERERS))
    (tmp_path / "main.c").write_text(code)
    run(tmp_path, "gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", "main", "main.c")
    image = np.array(run(tmp_path, str(tmp_path / "main")).split(), float).reshape(3, 4)
    y, x, s = np.indices((3, 4, 16), np.uint32)
    film = np.asarray(sampler(x, y, s), float)
    # Two bounces: twice the place on the film, and two pairs of numbers around 1/2.
    rest = image - 2 * (x + y + film.sum(axis=-1)).mean(axis=-1)
    assert np.all(abs(rest - 2) < 0.1)


def test_a_sampler_of_pbrt_has_the_points(shipped, tmp_path):
    sampler, text = shipped
    (tmp_path / "mine.h").write_text(text)
    (tmp_path / "main.cpp").write_text(PBRT.replace("@TEXT@", block("code-block:: cpp", RENDERERS)))
    run(tmp_path, "g++", "-Wall", "-Wextra", "-Werror", "-o", "main", "main.cpp")
    printed = np.array(run(tmp_path, str(tmp_path / "main")).split(), np.float32).reshape(16, 3)
    s = np.arange(16, dtype=np.uint32)
    assert np.array_equal(printed[:, :2], sampler(np.full_like(s, 3), np.full_like(s, 5), s))
    assert printed[:, 2].all()


def test_shaders_of_renderers_compile(shipped, tmp_path):
    """The text that three.js puts after its first line, and a kernel with what Unity includes."""
    sampler, _ = shipped
    script = block("code-block:: js", RENDERERS)
    body = re.search(r"fragmentShader: `(.*?)`", script, re.S)[1]
    glsl = body.replace("${text}", source(sampler, language="glsl"))
    (tmp_path / "three").write_text(f"#version 300 es\n{glsl}")
    run(tmp_path, "glslangValidator", "-S", "frag", "three")
    kernel = block("code-block:: hlsl", RENDERERS).replace("#pragma kernel Main\n", "")
    text = source(sampler, language="hlsl", vectors=256)
    (tmp_path / "unity").write_text(kernel.replace('#include "mine.hlsl"', text))
    run(tmp_path, "glslangValidator", "-D", "-V", "-S", "comp", "-e", "Main", "--amb", "unity")
