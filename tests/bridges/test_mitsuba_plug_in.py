"""Samplers of ours in Mitsuba 3, and its images with them."""

import json
import os
import re
import subprocess
import sys
import textwrap
from importlib.util import find_spec
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables

from qmcjax import orders, samplers, sequences
from qmcjax.bridges import mitsuba
from qmcjax.bridges._padding import padding_pair, padding_pixel
from qmcjax.bridges.mitsuba import _scalar as pixels
from qmcjax.bridges.mitsuba._given import Window, as_pixels
from qmcjax.core.checks import prng_key

ROOT = Path(__file__).parents[2]


def in_mitsuba(test):
    """Mark a slow test that needs Mitsuba."""
    return pytest.mark.slow(pytest.mark.skipif(find_spec("mitsuba") is None, reason="no Mitsuba")(test))


def in_llvm(test):
    """Mark a slow test that needs Mitsuba with LLVM."""
    return pytest.mark.slow(pytest.mark.usefixtures("llvm")(test))


@pytest.mark.slow
def test_the_library_does_not_need_it():
    """Neither Mitsuba nor the bridges are imported with the library."""
    script = "import sys, qmcjax; print('qmcjax.bridges' in sys.modules, 'mitsuba' in sys.modules)"
    assert run("-c", script).split() == ["False", "False"]


def environment():
    """Return that of processes that may import Mitsuba: they compile much, and compute little."""
    flags = f"{os.environ.get('XLA_FLAGS', '')} --xla_backend_optimization_level=0"
    return tables.environment(XLA_FLAGS=flags, JAX_NUMPY_DTYPE_PROMOTION="strict")


def run(*arguments):
    """Return what a process prints that may import Mitsuba."""
    how = {"cwd": ROOT, "env": environment(), "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, *arguments], **how)
    assert not done.returncode, done.stderr
    return done.stdout


def found_by(*arguments):
    return json.loads(run("tests/mitsuba_runs.py", *arguments))


RUNS = """
import json, sys, traceback
import mitsuba_runs
for line in sys.stdin:
    name, *given = json.loads(line)
    try:
        print(json.dumps([getattr(mitsuba_runs, name)(*given), ""]), flush=True)
    except Exception:
        print(json.dumps([None, traceback.format_exc()]), flush=True)
"""


@pytest.fixture(scope="module")
def shared():
    """Return a function like ``found_by``, of runs that share one process."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", RUNS], cwd=ROOT, env=environment(), **pipes) as process:

        def found_by(*arguments):
            process.stdin.write(json.dumps(arguments) + "\n")
            process.stdin.flush()
            found, error = json.loads(process.stdout.readline())
            assert not error, error
            return found

        yield found_by
        process.stdin.close()


@pytest.fixture(scope="module")
def whole_bytes():
    """Return an image of what is asked for, from a process that makes nothing else."""
    return found_by("whole_bytes")


VARIANTS = ["scalar_rgb", "llvm_ad_rgb"]


@pytest.fixture
def found_in(variant, request):
    """Return what finds something in a variant, if that runs here; scalar ones share a process."""
    if variant == "scalar_rgb":
        return request.getfixturevalue("shared")
    request.getfixturevalue("llvm")
    return found_by


ROUNDING = 8 * 2.0**-24
"""Mitsuba adds 8 numbers below 1 in float32."""


@in_mitsuba
def test_scalar_images_are_equal_across_passes_tiles_and_processes(whole_bytes, shared):
    """And are of the sampler's own coordinates."""
    found = shared("equal")
    assert found["points"] < ROUNDING and found["passes"] < ROUNDING and found["tiles"] == 0
    assert found["bytes"] == whole_bytes
    assert found["clone"] and found["fork"] and found["seek"]


@in_mitsuba
def test_what_cannot_be_is_refused():
    found_by("refused")


@in_mitsuba
def test_scalar_samples_have_the_bits_of_the_sampler(shared):
    """Each sampler of the tests' table, all its pairs and one of padding, at corners and edges of blocks."""
    found = shared("scalar_bits")
    assert len(found) > 30
    assert all(found.values()), found


@in_mitsuba
@pytest.mark.parametrize("variant", VARIANTS)
def test_loaded_scenes_have_the_images_of_described_ones(variant, found_in):
    """For sensors with crop windows, borders, lenses, parallel rays and media, and for seeds."""
    for name, off in found_in("replaced", variant).items():
        assert off < 1e-5, name


@in_mitsuba
@pytest.mark.parametrize("variant", VARIANTS)
def test_scenes_of_files(variant, found_in, tmp_path):
    """Paths and loaded scenes, samplers made for the film, and what goes wrong."""
    found = found_in("files", variant, str(tmp_path))
    assert found["same"] == [True, True] and found["sizes"] == [[20, 16, 2]]
    assert found["half"] < 0.1
    assert "crop_size = [12, 16]" in found["printed"]
    assert "\n  sampler = QmcSampler[\n    sampler = Independent(sobol(dims=6))" in found["printed"]
    assert "sample_count = 2" in found["printed"]


@in_llvm
def test_scenes_like_those_of_production():
    """Variants have the same images up to rounding; of glass and smoke the same means, to 5 sigma."""
    scalar, llvm = (found_by("production", variant) for variant in VARIANTS)
    assert len(scalar) == 8 and scalar.keys() == llvm.keys()
    for name, (size, image) in scalar.items():
        one, other = np.array(image), np.array(llvm[name][1])
        assert one.shape == other.shape == (*size, 3) and one.mean() > 0.05, name
        if name in ("glass", "volume"):
            difference = np.mean(one - other, axis=2)
            error = difference.std() / np.sqrt(difference.size)
            assert 0 < abs(difference.mean()) < 5 * error, name
        else:
            assert abs(one - other).max() < 1e-3, name


def check_unbiased(found):
    # Student's t with some 46 degrees of freedom: 5.6 is what 5 is of a normal variable.
    assert abs(found["whole"]) < 5.6
    # Of some 100 pixels, colours alike: t**2 has the mean 1.05 and a standard deviation of about 1.6.
    assert found["square"] < 1.05 + 5 * 1.6 / 10


@in_mitsuba
def test_scalar_images_are_unbiased(shared):
    """Beside images with Mitsuba's own independent samples, pixel by pixel and as a whole."""
    check_unbiased(shared("unbiased", "scalar_rgb"))


@pytest.fixture(scope="module")
def llvm():
    """Skip unless Mitsuba runs with LLVM."""
    if find_spec("mitsuba") is None:
        pytest.skip("Mitsuba is not installed")
    try:
        mitsuba.check_llvm()
    except RuntimeError as error:
        assert "need LLVM 19" in str(error)
        pytest.skip(str(error))


@in_llvm
@pytest.mark.parametrize("of", ["bits", "in_loops"])
def test_arrays_have_the_bits_of_the_sampler(of):
    """All coordinates of each sampler of the tests' table; pairs in loops of different lengths."""
    for name, equal in found_by(of).items():
        assert all(equal), (name, equal)


@in_llvm
@pytest.mark.parametrize("variant", VARIANTS)
def test_pixels_are_the_films(variant):
    """For films of any size, crops, borders and blocks, passes and seeds: an integrator shows which."""
    found = found_by("shown", variant)
    for name, (places, mean) in found.items():
        assert places and mean == (13.5 if name == "seed" else 11.5), name


@in_llvm
@pytest.mark.parametrize("integrator", ["path", "prb", "volpath", "prbvolpath", "ptracer", "aov"])
def test_vectorized_images_are_unbiased(integrator):
    check_unbiased(found_by("unbiased", "llvm_ad_rgb", integrator))


@in_llvm
def test_gradients_of_the_sky():
    """The image is linear in it: 5.4 is what 5 is of a normal variable, with 7 degrees of freedom 11."""
    found = np.array(found_by("gradients"))
    difference = found[:, 1] - found[:, 0]
    assert abs(difference.mean()) < 11 * difference.std(ddof=1) / np.sqrt(8)
    assert abs(difference).max() < 0.2 * found[:, 0].mean() and found[:, 0].mean() > 0.1


@in_llvm
def test_wavefronts(whole_bytes):
    """What holds in scalar variants holds with LLVM."""
    found = found_by("wavefronts")
    assert "spp must be at most 4" in found["sample"] and "spp must be at most 4" in found["seed"]
    assert "film must be the sensor's film, got another" in found["film"]
    assert "film must be the sensor's film" in found["size"]
    assert "size of a wavefront must be the number of pixels" in found["wavefront"]
    assert "mitsuba_runs.py" in found["NumPy"], found["NumPy"]
    assert found["clone"] and found["seek"]
    assert max(found[name] for name in ("points", "passes", "split", "tiles")) < ROUNDING
    scalar = np.frombuffer(bytes.fromhex(whole_bytes)).reshape(36, 40, 3)
    assert abs(np.array(found["image"]) - scalar).max() < ROUNDING


@in_mitsuba
def test_llvm_is_checked_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    with pytest.raises(RuntimeError, match=r"no LLVM is found .* need LLVM 19"):
        mitsuba.check_llvm()


def test_without_it_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    with pytest.raises(ImportError, match=r"pip install 'qmcjax\[mitsuba\]'"):
        mitsuba.register()


@in_mitsuba
def test_the_page_of_the_documentation_runs(tmp_path):
    page = (ROOT / "figures" / "docs" / "bridges" / "mitsuba.rst").read_text(encoding="utf-8")
    blocks = re.findall(r"\.\. code-block:: python\n\n((?: {3}.*\n|\n)+)", page)
    assert len(blocks) == 5
    script = f"import os\nos.chdir({str(tmp_path)!r})\n" + "\n".join(map(textwrap.dedent, blocks))
    printed = run("-c", script)
    assert printed.splitlines()[0] == "True" and (tmp_path / "box.png").stat().st_size > 1000
    theirs, ours = re.findall(r"\[[^]]*\]", printed)
    assert np.allclose(np.fromstring(theirs[1:-1], sep=","), np.fromstring(ours[1:-1], sep=" "), atol=1e-6)


def points_of(sampler, key=0, origin=(0, 0, 0), count=16):
    return pixels.Points(sampler, key=prng_key("key", key), origin=origin, count=count, threads=1)


def requested(points, pairs, x, y, sample):
    """Return pairs of one sample, shape (pairs, 2)."""
    found = []
    for pair in pairs:
        group, number = points.place(pair)
        found.append(points.tables(group)(x, y, sample)[2 * number : 2 * number + 2])
    return found


@pytest.mark.parametrize("origin", [(0, 0, 0), (7, 2, 6)])
def test_pairs_of_the_sampler_are_its_own(origin):
    """At both sides of tables, before and behind their origin; an odd last coordinate is omitted."""
    sampler = samplers.independent(sequences.sobol(11), 3)
    points = points_of(sampler, origin=origin)
    assert points.own == 5
    for where in ((0, 0, 0), (7, 2, 5), (6, 18, 22), (23, 17, 6), (65535, 65535, 2**32 - 2)):
        wanted = np.asarray(sampler(*where, tuple(range(10)))).reshape(5, 2)
        assert np.array_equal(requested(points, range(5), *where), wanted)


def test_pairs_beyond_are_those_of_all_bridges():
    """Of any pixel, sample and number of a pair, for two keys."""
    pairs = (*range(1, 40), 257, 65537)
    for key in (5, 6):
        points = points_of(samplers.independent(sequences.sobol(2), 0), key)
        words = jax.random.bits(prng_key("key", key), (2,), jnp.uint32)
        for x, y, s in ((0, 0, 0), (7, 2, 5), (65535, 65535, 15)):
            pixel = padding_pixel(words, *map(jnp.uint32, (x, y)))
            wanted = padding_pair(pixel, jnp.asarray(pairs, jnp.uint32), jnp.uint32(s))
            assert np.array_equal(requested(points, pairs, x, y, s), wanted)


def test_a_seed_is_told_or_refused():
    """Each rendering with another seed than 0 has numbers that are too large, whatever the film's size."""
    for side, width, height in ((4, 5, 3), (2, 8, 8), (32, 3, 3)):
        count = -(-width // side) * -(-height // side)
        corners = np.stack([np.arange(count) * side, np.zeros(count, int)], axis=-1)
        blocks = pixels.Blocks(Window(width, height, 10, 20), corners, side)
        x, y = orders.morton(side, side).pixel(np.tile(np.arange(side**2, dtype=np.uint32), count))
        x = np.asarray(x) + np.repeat(side * np.arange(count), side**2) + 10
        found = [blocks.pixel(seed) for seed in range(count * side**2)]
        assert np.array_equal(found, np.stack([x, np.asarray(y) + 20], axis=-1))
        for seed in (1, 2, 7):
            with pytest.raises(ValueError, match="seed must be 0 in scalar variants"):
                for number in range(count * side**2):
                    blocks.pixel(seed * width * height + number)
    assert pixels.block_side(Window(64, 33, 0, 0), 4, 0) == 32
    assert pixels.block_side(Window(64, 32, 0, 0), 4, 0) == 16
    assert pixels.block_side(Window(64, 32, 0, 0), 4, 8) == 8


def test_what_is_no_sampler_is_refused():
    with pytest.raises(TypeError, match="sampler must be a sampler"):
        as_pixels("sampler", sequences.sobol(2))
    with pytest.raises(ValueError, match="at least the two coordinates of a pixel, got 1"):
        as_pixels("sampler", samplers.independent(sequences.van_der_corput(), 0))
