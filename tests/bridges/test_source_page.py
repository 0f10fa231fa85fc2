"""The page of the documentation on source code: its calls compile, and that in C prints what it says."""

import re
import shutil
import subprocess
import textwrap
from pathlib import Path

import numpy as np
import pytest
import shaders

from qmcjax.bridges import source

PAGE = (Path(__file__).parents[2] / "figures" / "docs" / "bridges" / "source.rst").read_text(encoding="utf-8")

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


def block(directive):
    """Return the first block of a directive on the page."""
    found = re.search(rf"\.\. {re.escape(directive)}\n\n((?: {{3}}.*\n|\n)+)", PAGE)
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


def test_glsl_compiles(sampler, tmp_path):
    text = source(sampler, language="glsl")
    (tmp_path / "mine.frag").write_text(block("code-block:: glsl").replace('#include "mine.glsl"', text))
    run(tmp_path, "glslangValidator", "mine.frag")


def test_hlsl_compiles(sampler, tmp_path):
    (tmp_path / "mine.hlsl").write_text(f"{source(sampler, language='hlsl')}{block('code-block:: hlsl')}")
    run(tmp_path, "glslangValidator", "-D", "-V", "-S", "comp", "-e", "main", "--amb", "mine.hlsl")


def test_wgsl_compiles(sampler):
    device = shaders.device()
    if isinstance(device, str):
        pytest.skip(device)
    code = f"{source(sampler, language='wgsl')}{block('code-block:: wgsl')}"
    module = device.create_shader_module(code=code)
    device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})


def test_cuda_compiles(sampler, tmp_path):
    (tmp_path / "mine.cu").write_text(f"{source(sampler, language='cuda')}{block('code-block:: cuda')}")
    (tmp_path / "device.h").write_text(DEVICE)
    options = ("--cuda-device-only", "--cuda-gpu-arch=sm_70", "-nocudainc", "-nocudalib", "-fsyntax-only")
    run(tmp_path, "clang", "-x", "cuda", *options, "-include", "device.h", "mine.cu")
