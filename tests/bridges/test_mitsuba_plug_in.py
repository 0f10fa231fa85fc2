"""Samplers of ours in Mitsuba 3: which pixel is asked for, what they hand out, and its images with them."""

import json
import os
import re
import subprocess
import sys
import textwrap
from importlib.util import find_spec
from pathlib import Path

import jax
import numpy as np
import pytest

from figures.ours import mitsuba_samplers
from qmcjax import orders, samplers, sequences
from qmcjax.bridges import mitsuba
from qmcjax.bridges.mitsuba import _pixels as pixels
from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs
from qmcjax.bridges.mitsuba._streams import TILE, Stream

ROOT = Path(__file__).parents[2]

needs_mitsuba = pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba is not installed")


def all_pairs(spp, width=8, height=8):
    return pixels.Wavefront(pixels.Window(width, height, 0, 0), spp, 0)


def test_pairs_of_the_sampler_are_its_own():
    """Also those that are computed together, of all samples in order and of one alone."""
    sampler = samplers.independent(sequences.sobol(11), 3)
    stream = Stream(PaddedPairs(sampler, 0))
    samples = pixels.Wavefront(pixels.Window(5, 3, 7, 2), 4, 6)
    stream.put(samples)
    x, y, sample = samples.where(np.arange(60, dtype=np.uint32))
    assert (x[:5].tolist(), y[-1], sample[:5].tolist()) == ([7, 7, 7, 7, 8], 4, [6, 7, 8, 9, 6])
    points = np.asarray(sampler(x, y, sample, tuple(range(10))))
    for pair in range(5):
        wanted = points[:, 2 * pair : 2 * pair + 2]
        assert np.array_equal(np.transpose(stream.of_all(pair)), wanted)
        stream.put(samples)
        assert stream.of_sample(pair, 17) == tuple(wanted[17].tolist())


def test_requests_keep_pairs_together():
    """A single coordinate takes the first of a pair, the next one what is left of it."""
    stream = Stream(PaddedPairs(samplers.independent(sequences.sobol(4), 0), 0))
    asked = [stream.two(), stream.one(), stream.two(), stream.one(), stream.one(), stream.two(), stream.one()]
    assert asked == [0, (1, 0), 2, (1, 1), (3, 0), 4, (3, 1)]
    stream.restart()
    assert (stream.two(), stream.one()) == (0, (1, 0))


def test_tiles_do_not_show():
    """Samples on both sides of the border of two tiles, and in a last one that is not full."""
    sampler = samplers.independent(sequences.sobol(2), 1)
    stream = Stream(PaddedPairs(sampler, 0))
    samples = pixels.Wavefront(pixels.Window(300, 73, 0, 0), 4, 0)
    assert samples.count > TILE and samples.count % TILE
    stream.put(samples)
    first, second = stream.of_all(0)
    some = np.array([0, TILE - 1, TILE, samples.count - 1], np.uint32)
    wanted = np.asarray(sampler(*samples.where(some)))
    assert np.array_equal(np.stack([first[some], second[some]], axis=-1), wanted)
    assert [stream.of_sample(0, int(k)) for k in some] == [tuple(row) for row in wanted.tolist()]
    with pytest.raises(
        ValueError, match=f"sample must be one of {samples.count}, got number {samples.count}"
    ):
        stream.of_sample(0, samples.count)


def padded(spp, pairs=(1, 2), key=5, side=16):
    """Return pairs behind those of a sampler, shape (pairs, pixels, spp, 2)."""
    stream = Stream(PaddedPairs(samplers.independent(sequences.sobol(2), 0), key))
    stream.put(all_pairs(spp, side, side))
    values = [np.transpose(stream.of_all(pair)) for pair in pairs]
    return np.reshape(values, (len(pairs), side**2, spp, 2))


def test_padding_is_of_nets():
    """The first 4 of 16 samples, and all, have one in each elementary interval."""
    values = padded(16).reshape(-1, 16, 2)
    for count in (4, 16):
        m = count.bit_length() - 1
        for k in range(m + 1):
            rows, columns = (
                np.floor(values[:, :count, j] * 2**bits).astype(int) for j, bits in ((0, k), (1, m - k))
            )
            assert (np.sort(rows * 2 ** (m - k) + columns, axis=1) == np.arange(count)).all()


def test_padding_is_fresh():
    """No pair repeats another, a key's or a pixel's; halves of two pairs are shuffled, not the same."""
    values = padded(16)
    points, others = (
        {tuple(row) for row in of.reshape(-1, 2).tolist()} for of in (values, padded(16, key=6))
    )
    assert len(points) == values.size // 2 and not points & others
    many = padded(1, pairs=(*range(1, 40), 257, 65537), side=4)
    assert len(np.unique(many.reshape(-1, 2), axis=0)) == 41 * 4**2
    halves = values[..., 0] < 0.5
    same = (halves[0] == halves[1]).mean(axis=1)
    # Without shuffles all or none of a pixel's samples are in the same halves; with them 8 of 16 mostly.
    assert ((same == 0) | (same == 1)).mean() < 0.05
    # And are uncorrelated over pixels: 5 sigma of 256 independent means of +-1 over 16 samples.
    assert abs(np.mean(2 * same - 1)) < 5 / np.sqrt(256)


def test_blocks_in_morton_order():
    """Pixels of blocks, those beyond an edge standing for its last ones."""
    window = pixels.Window(5, 3, 10, 20)
    block = pixels.Block(window, (4, 0), 4, 2, 1)
    x, y, sample = block.where(np.arange(block.count, dtype=np.uint32))
    assert sample.tolist() == [1, 2] * 16
    order = orders.morton(4, 4)
    columns, rows = (np.asarray(part) for part in order.pixel(np.arange(16, dtype=np.uint32)))
    assert np.array_equal(x[::2], np.minimum(columns + 4, 4) + 10)
    assert np.array_equal(y[::2], np.minimum(rows, 2) + 20)


def test_a_seed_is_told_or_refused():
    """Each rendering with another seed than 0 has numbers that are too large, whatever the film's size."""
    for side, width, height in ((4, 5, 3), (2, 8, 8), (32, 3, 3)):
        count = -(-width // side) * -(-height // side)
        blocks = pixels.Blocks(pixels.Window(width, height, 0, 0), np.zeros((count, 2), np.int64), side)
        numbers = [blocks.found(seed) for seed in range(count * side**2)]
        assert numbers == [(b, i) for b in range(count) for i in range(side**2)]
        for seed in (1, 2, 7):
            with pytest.raises(ValueError, match="seed must be 0 in scalar variants"):
                for number in range(count * side**2):
                    blocks.found(seed * width * height + number)
    assert pixels.block_side(pixels.Window(64, 33, 0, 0), 4, 0) == 32
    assert pixels.block_side(pixels.Window(64, 32, 0, 0), 4, 0) == 16
    assert pixels.block_side(pixels.Window(64, 32, 0, 0), 4, 8) == 8


def test_what_is_no_sampler_is_refused():
    with pytest.raises(TypeError, match="sampler must be a sampler"):
        PaddedPairs(sequences.sobol(2), 0)
    with pytest.raises(ValueError, match="at least the two coordinates of a pixel, got 1"):
        PaddedPairs(samplers.independent(sequences.van_der_corput(), 0), 0)
    outside = samplers.function(lambda x, y, sample: jax.numpy.full((*x.shape, 2), 1.5), 2)
    stream = Stream(PaddedPairs(outside, 0))
    with pytest.raises(ValueError, match="seed or seek must set the pixels"):
        stream.of_all(0)
    stream.put(all_pairs(1))
    with pytest.raises(ValueError, match=r"points in \[0, 1\), got \[1.5, 1.5\] in pixel \(0, 0\), sample 0"):
        stream.of_sample(0, 0)


@pytest.mark.slow
def test_the_library_does_not_need_it():
    """Neither Mitsuba nor the bridges are imported with the library."""
    script = "import sys, qmcjax; print('qmcjax.bridges' in sys.modules, 'mitsuba' in sys.modules)"
    assert run("-c", script).split() == ["False", "False"]


def run(*arguments):
    """Return what a process prints that may import Mitsuba."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAX_NUMPY_DTYPE_PROMOTION": "strict"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert not done.returncode, done.stderr
    return done.stdout


def found_by(*arguments):
    return json.loads(run("tests/mitsuba_runs.py", *arguments))


ROUNDING = 8 * 2.0**-24
"""Mitsuba adds 8 numbers below 1 in float32."""


@needs_mitsuba
@pytest.mark.slow
def test_scalar_variants_are_told_the_pixel():
    """For films of any size, crops, borders and blocks: an integrator shows which."""
    for name, found in found_by("places").items():
        assert found == [True, [11.5]], name


@needs_mitsuba
@pytest.mark.slow
def test_scalar_images_are_equal_across_passes_tiles_and_processes():
    """And are of the sampler's own coordinates."""
    found = found_by("equal")
    assert found["points"] < ROUNDING and found["passes"] < ROUNDING and found["tiles"] == 0
    assert found["bytes"] == found_by("whole_bytes")
    assert found["clone"] and found["fork"] and found["seek"]


@needs_mitsuba
@pytest.mark.slow
def test_what_cannot_be_is_refused():
    found = found_by("refused")
    for name, words in {
        "seed": "seed must be 0 in scalar variants",
        "passes": "samples_per_pass unset",
        "size": "width, height must be the order's 8 x 8, got 8 x 4",
        "count": "spp must be at most 4 samples in the block of a pixel, got 8",
        "nothing": "film must be a parameter of the plugin",
        "film": "TypeError: film must be the sensor's film, got 3",
        "sampler": "TypeError: sampler must be made by qmcjax.bridges.mitsuba.held, got 3",
        "key": "key must be an integer",
        "block": "block_size must be a power of two, got 3",
        "variant": "ValueError: variant must be one of",
        "no name": "TypeError: variant must be the name of a variant, got 3",
        "held": "TypeError: sampler must be a sampler",
        "seek": "ValueError: x must be an integer in [0, 39], got 40",
        "beyond": "sample_count must be the number of samples taken, got 4",
    }.items():
        assert words in found[name], found[name]


def check_unbiased(found):
    # Student's t with some 46 degrees of freedom: 5.6 is what 5 is of a normal variable.
    assert abs(found["whole"]) < 5.6
    # Of some 100 pixels, colours alike: t**2 has the mean 1.05 and a standard deviation of about 1.6.
    assert found["square"] < 1.05 + 5 * 1.6 / 10


@needs_mitsuba
@pytest.mark.slow
def test_scalar_images_are_unbiased():
    """Beside images with Mitsuba's own independent samples, pixel by pixel and as a whole."""
    check_unbiased(found_by("unbiased", "scalar_rgb"))


@needs_mitsuba
@pytest.mark.slow
def test_wavefronts():
    """What holds in scalar variants holds with LLVM, where there is one that Mitsuba runs with."""
    try:
        mitsuba.check_llvm()
    except RuntimeError as error:
        assert "need LLVM 19" in str(error)
        pytest.skip(str(error))
    check_unbiased(found_by("unbiased", "llvm_ad_rgb"))
    found = found_by("wavefronts")
    assert "symbolic loops must be off" in found["symbolic"]
    assert "any wavefront" not in found
    assert "spp must be at most 4" in found["sample"] and "seed must leave" in found["seed"]
    assert found["clone"] and found["seek"] and found["gradients"] == [True, False]
    assert max(found[name] for name in ("points", "passes", "split", "tiles")) < ROUNDING
    scalar = np.frombuffer(bytes.fromhex(found_by("whole_bytes"))).reshape(36, 40, 3)
    assert abs(np.array(found["image"]) - scalar).max() < ROUNDING


@needs_mitsuba
@pytest.mark.slow
def test_llvm_is_checked_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    with pytest.raises(RuntimeError, match=r"no LLVM is found .* need LLVM 19"):
        mitsuba.check_llvm()


def test_the_figure_says_that_it_is_missing(monkeypatch):
    monkeypatch.setattr(mitsuba_samplers.mitsuba_scenes, "installed", lambda: False)
    _, numbers, *images = mitsuba_samplers.make("draft", lambda part: None)
    assert "pip install 'qmcjax[mitsuba]'" in numbers["note"] and not images and not numbers["measured"]


@pytest.mark.skipif(find_spec("mitsuba") is not None, reason="Mitsuba is installed")
def test_without_it_the_extra_is_named():
    with pytest.raises(ImportError, match=r"pip install 'qmcjax\[mitsuba\]'"):
        mitsuba.register()


@needs_mitsuba
@pytest.mark.slow
def test_the_page_of_the_documentation_runs(tmp_path):
    page = (ROOT / "figures" / "docs" / "bridges" / "mitsuba.rst").read_text(encoding="utf-8")
    blocks = re.findall(r"\.\. code-block:: python\n\n((?: {3}.*\n|\n)+)", page)
    assert len(blocks) == 5
    script = f"import os\nos.chdir({str(tmp_path)!r})\n" + "\n".join(map(textwrap.dedent, blocks))
    printed = run("-c", script)
    assert printed.splitlines()[0] == "True" and (tmp_path / "box.png").stat().st_size > 1000
    theirs, ours = re.findall(r"\[[^]]*\]", printed)
    assert np.allclose(np.fromstring(theirs[1:-1], sep=","), np.fromstring(ours[1:-1], sep=" "), atol=1e-6)
