"""Samplers of ours in Mitsuba 3, and its images with them."""

import json
import os
import re
import subprocess
import sys
import textwrap
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import tables

from figures.ours import mitsuba_samplers
from qmcjax.bridges import mitsuba

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
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, env=environment(), capture_output=True, text=True
    )
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
    with subprocess.Popen(
        [sys.executable, "-c", RUNS],
        cwd=ROOT,
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:

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
    """Lenses, many lamps, glass, smoke, skies, masks, hair and rooms: variants have the same images.

    Up to rounding. In glass and smoke scalar variants do not request pairs that are not used: other pairs
    follow, and only the means of images are the same, to 5 standard errors of the difference of pixels.
    """
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
def test_symbolic_and_evaluated_loops_are_the_same():
    """The same images; particle tracers add to pixels in any order."""
    found = found_by("modes")
    assert found.pop("ptracer") < 1e-5
    assert found == dict.fromkeys(found, 0.0)


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


@in_llvm
@pytest.mark.parametrize("variant", VARIANTS)
def test_samplers_of_one_image_size_are_made_for_it(variant):
    found = found_by("of_size", variant)
    assert found == {"asked": [[40, 36, 2], [40, 36, 8]], "same": [True, True]}


@in_mitsuba
def test_llvm_is_checked_in_a_process_of_its_own(monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    with pytest.raises(RuntimeError, match=r"no LLVM is found .* need LLVM 19"):
        mitsuba.check_llvm()


def test_the_figure_says_that_it_is_missing(monkeypatch):
    monkeypatch.setattr(mitsuba_samplers.mitsuba_scenes, "installed", lambda: False)
    _, numbers, *images = mitsuba_samplers.make("draft", lambda part: None)
    assert "pip install 'qmcjax[mitsuba]'" in numbers["note"] and not images and not numbers["measured"]


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
