"""Comparisons of samplers: what is measured, how sure it is, and promises that samplers break."""

import re
from dataclasses import dataclass
from itertools import count

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from tables import Table

import analysis
import qmcjax as qj
from analysis._comparing.convergence import timed
from qmcjax import orders, samplers, scenes, sequences

SIDE, SPP = 32, 16


class Plug:
    dims = 2

    def __init__(self, points):
        self.made = points

    def __call__(self, x, y, sample, dims, dtype):
        return self.made(x, y, sample)[..., list(dims)].astype(dtype)


def good(x, y, sample):
    number = (y * np.uint32(SIDE) + x) * np.uint32(SPP) + sample
    steps = np.array([3242174889, 2447445414], np.uint32)
    return jnp.stack([(number * step >> np.uint32(8)).astype(jnp.float32) / 2**24 for step in steps], axis=-1)


class ByPlace:
    """The first coordinate that is asked for is always the same one."""

    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return good(x, y, sample)[..., : len(dims)].astype(dtype)


@qj.pytree
@dataclass(frozen=True)
class Keyed:
    """Its key becomes an argument of programs, which NumPy cannot read."""

    key: int
    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return good(x, y, sample ^ np.uint32(self.key))[..., list(dims)].astype(dtype)


CALLS = count()


def shifted(x, y, sample):
    return (good(x, y, sample) + (0.25 if x.ndim else 0)) % 1


BREAKS = {
    "range": (Plug(lambda x, y, s: good(x, y, s) * 1.01), r"coordinate \d of pixel .* are in \[0, 1\)"),
    "nan": (Plug(lambda x, y, s: jnp.where((s == 3)[..., None], jnp.nan, good(x, y, s))), "sample 3, is nan"),
    "repeats": (Plug(lambda x, y, s: good(x, y, s // 2)), "samples 0 and 1 of pixel .* are the same point"),
    "uniform": (Plug(lambda x, y, s: good(x, y, s) ** 2), "coordinate 0 is not uniform"),
    "state": (Plug(lambda x, y, s: good(x, y, s) / 2 + next(CALLS) / 99), "a second call gives other points"),
    "company": (Plug(shifted), "one sample, 0 of pixel .* gives other points"),
    "dims": (ByPlace(), "gives other points"),
    "scalars": (Plug(lambda x, y, s: jnp.full(2, float(x) / 99)), "a call with arrays .* fails: TypeError"),
    "key": (Keyed(1), "jax.jit fails: TracerArrayConversionError"),
    "shape": (Plug(lambda x, y, s: good(x, y, s)[..., None]), "a call with arrays .* fails"),
}


@pytest.mark.parametrize("name", BREAKS)
def test_a_broken_promise_is_told(name):
    sampler, sentence = BREAKS[name]
    broken = analysis.broken_promises(sampler, SIDE, SIDE, SPP)
    assert any(re.search(sentence, each) for each in broken), broken


KEPT = Table(
    {
        "own": lambda: Plug(good),
        "Owen": lambda: samplers.independent(sequences.sobol(3), 1),
        "Z": lambda: samplers.z(SIDE, SIDE, SPP, 1),
        "Hilbert": lambda: samplers.contiguous(orders.hilbert(SIDE, SIDE), sequences.halton(2), SPP),
        "mask": lambda: samplers.dither(samplers.blue_noise_mask(2), sequences.lattice(2)),
        "screen": lambda: samplers.full_screen(sequences.sobol(4), SIDE, SIDE),
        "ranked": lambda: samplers.ranked(2, 1),
        "lattice in each pixel": lambda: samplers.independent(sequences.rank1_lattice(SPP), 1, "shift"),
    }
)


@pytest.mark.slow
@pytest.mark.parametrize("name", KEPT)
def test_samplers_keep_their_promises(name):
    assert analysis.broken_promises(KEPT[name], SIDE, SIDE, SPP) == []


def test_a_sampler_that_refuses_says_why():
    (sentence,) = analysis.broken_promises(samplers.z(SIDE, SIDE, 4, 1), SIDE, SIDE, SPP)
    assert sentence.startswith("it refuses 32 x 32 pixels with 16 samples: spp must be")


def owen(key):
    return samplers.independent(sequences.sobol(2), key)


def other_owen(width, height, spp, key):
    """Like the former, which compiles but once for both, from all parameters that there are."""
    assert (width, height) == (SIDE, SIDE) and spp <= SPP
    return owen(key + 10)


@pytest.fixture(scope="module")
def comparison():
    made = {
        "Owen": owen,
        "Owen, other keys": other_owen,
        "fixed": KEPT["screen"],
        "few": samplers.z(SIDE, SIDE, 4, 1),
    }
    made["deaf"] = lambda key: KEPT["screen"]
    worlds = {"disc": scenes.disc(), "ball": scenes.ball()}
    return analysis.compare(made, worlds, [1, 4, 16], width=SIDE, height=SIDE, keys=4)


@pytest.mark.slow
def test_values_are_those_of_images(comparison):
    exact, _ = scenes.disc().reference(SIDE, SIDE)
    images = [np.asarray(qj.render(scenes.disc(), owen(key), SIDE, SIDE, 4), np.float64) for key in range(4)]
    row = comparison.row("disc", "Owen", 4)
    assert row.values["filtered error"] == tuple(analysis.filtered_error(image, exact) for image in images)
    logarithms = [np.log(np.mean((image - exact) ** 2)) / 2 for image in images]
    assert np.log(row.mean("RMS error")) == pytest.approx(np.mean(logarithms), rel=1e-12)
    interval = stats.t.interval(0.95, 3, np.mean(logarithms), stats.sem(logarithms))
    np.testing.assert_allclose(np.log(row.interval("RMS error")), interval)
    np.testing.assert_array_equal(row.image, images[0].astype(np.float32))
    powers = [analysis.radial_average(analysis.error_spectrum(image, exact))[1] for image in images]
    np.testing.assert_allclose(row.power, np.mean(powers, axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fixed", "deaf"])
def test_what_has_one_image_has_no_interval(comparison, name):
    """Without a key, or with one that changes nothing."""
    row = comparison.row("disc", name, 4)
    assert {len(values) for values in row.values.values()} == {1}
    assert row.interval("RMS error") == (0, np.inf)
    assert comparison.slope("disc", name)[1:] == (-np.inf, np.inf)
    assert comparison.ranks("disc", 4)[name][1:] == (1, 5)


@pytest.mark.slow
def test_what_cannot_be_rendered_is_left_out_with_the_reason(comparison):
    assert "spp must be" in comparison.left_out["disc", "few", 16]
    assert comparison.left_out["ball", "Owen", 4] == "it has 2 dimensions, the scene needs 3"
    assert ("ball", "fixed", 4) not in comparison.left_out
    with pytest.raises(KeyError, match="it has 2 dimensions"):
        comparison.row("ball", "Owen", 4)
    assert len(comparison.rows) + len(comparison.left_out) == 5 * 3 * 2
    assert comparison.promises["few"][0].startswith("it refuses")


def test_time_is_that_of_a_compiled_program(monkeypatch):
    """Of makers that return a new object each time, too: each is traced anew, but not while it is timed."""
    traces, seconds, while_timed = [], [], []

    def traced(x, y, sample):
        traces.append(sample)
        return good(x, y, sample)

    def counted(*rendering):
        before = len(traces)
        found = timed(*rendering)
        seconds.append(found[0])
        while_timed.append(len(traces) - before)
        return found

    monkeypatch.setattr("analysis._comparing.compare.timed", counted)
    made = {"new": lambda key: Plug(lambda x, y, s: traced(x, y, s))}
    result = analysis.compare(made, {"disc": scenes.disc()}, [4], width=SIDE, height=SIDE, keys=2)
    assert while_timed == [0, 0, 0] and len(traces) > 2
    assert 0 < result.row("disc", "new", 4).seconds == np.median(seconds)


def test_what_fails_is_left_out_with_the_reason():
    """Whatever a sampler returns or raises, others are compared."""

    def later(x, y, sample):  # Not where promises are tried out.
        return jnp.where((x == 40)[..., None], 1.0, good(x, y, sample))

    def missing(key):
        return {}["key"]

    made = {
        "one": (
            lambda: Plug(later),
            r"sampler must return points in \[0, 1\), got \[1.0, 1.0\] in pixel \(40, 0",
        ),
        "nan": (lambda: Plug(lambda x, y, s: good(x, y, s) * jnp.nan), r"sampler must return points .*nan"),
        "raises": (lambda: Plug(lambda x, y, s: 1 / 0), "ZeroDivisionError: division by zero"),
        "dtype": (lambda: samplers.function(lambda x, y, s: x, 2), "f must return points of shape"),
        "maker": (missing, "KeyError: 'key'"),
    }
    worlds = {"disc": scenes.disc()}
    makers = {name: make for name, (make, _) in made.items()} | {"Owen": owen}
    result = analysis.compare(makers, worlds, [4], width=64, height=32, keys=1)
    assert [row.sampler for row in result.rows] == ["Owen"] and result.promises["Owen"] == []
    for name, (_, why) in made.items():
        assert re.search(why, result.left_out["disc", name, 4]) and result.promises[name], name


def test_a_class_may_hold_a_sequence():
    class Own:
        dims = 2

        def __init__(self):
            self.sequences = (sequences.sobol(2),)

        def __call__(self, x, y, sample, dims, dtype):
            return self.sequences[0](y * np.uint32(SIDE) + x + sample * np.uint32(2**10), dims, dtype)

    assert analysis.broken_promises(Own(), SIDE, SIDE, 4) == []
    points = samplers.as_sampler("sampler", Own())(3, 5, 2)
    np.testing.assert_array_equal(points, sequences.sobol(2)(5 * SIDE + 3 + 2 * 2**10))


def test_ranks_say_who_is_told_apart():
    def of(values):
        return {"RMS error": tuple(values)}

    def row(sampler, values):
        return analysis.ComparisonRow(
            "s", sampler, 1, of(values), 0.0, np.zeros(1), np.zeros(1), np.zeros((2, 2))
        )

    rows = row("best", [1.0, 1.1, 0.9, 1.0]), row("a", [2.0, 2.6, 2.2, 2.4]), row("b", [2.1, 2.5, 2.3, 2.4])
    ranks = analysis.Comparison(rows, {}, {}, {}, {}).ranks("s", 1)
    assert ranks["best"] == (1, 1, 1)
    assert sorted(rank for rank, _, _ in ranks.values()) == [1, 2, 3]
    assert ranks["a"][1:] == ranks["b"][1:] == (2, 3)


@pytest.mark.slow
def test_slopes(comparison):
    slope, low, high = comparison.slope("disc", "Owen")
    spps, errors = comparison.errors("disc", "Owen")
    assert slope == pytest.approx(np.polyfit(np.log(spps), np.log(errors), 1)[0])
    assert low <= slope <= high and slope < -0.5


@pytest.mark.slow
def test_points_are_measured_where_they_are(comparison):
    measured = comparison.points["fixed"][4]
    y, x, sample = np.indices((16, 16, 4), np.uint32)
    own = np.asarray(KEPT["screen"](x, y, sample), np.float64)
    whole = ((own + np.stack([x, y], axis=-1)) / 16).reshape(-1, 2)
    assert measured["star discrepancy"] == pytest.approx(analysis.star_discrepancy(whole), rel=1e-12)
    assert measured["largest t in a pixel"] == max(
        analysis.t_value(own[i, j]) for i in range(4) for j in range(4)
    )
    assert 0 < measured["relative minimum distance"] < 1


@pytest.mark.slow
def test_the_table_is_one_of_plain_values(comparison):
    table = comparison.table()
    assert len(table) == len(comparison.rows)
    assert {type(value) for row in table for value in row.values()} == {str, int, float}
    assert len({tuple(row) for row in table if row["spp"] > 1}) == 1


def test_samplers_have_names():
    with pytest.raises(TypeError, match="samplers must map names to samplers"):
        analysis.compare([owen], {"disc": scenes.disc()}, [1])
