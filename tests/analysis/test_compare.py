"""Comparisons of samplers: what is measured, how sure it is, and promises that samplers break."""

import re
from dataclasses import dataclass
from itertools import count

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from tables import SAMPLERS, Table, few

import analysis
import qmcjax as qj
from analysis._comparing import promises
from analysis._comparing.convergence import time_render
from qmcjax import samplers, scenes, sequences
from qmcjax.core import checks
from qmcjax.core.bits import hash_word, to_unit
from qmcjax.samplers.turned_tiles import stratified

SIDE, SPP = 32, 16


def in_type(points, dtype):
    with checks.precision(dtype):
        return points.astype(dtype)


class Plug:
    dims = 2

    def __init__(self, points):
        self.made = points

    def __call__(self, x, y, sample, dims, dtype):
        return in_type(self.made(x, y, sample)[..., list(dims)], dtype)


def good(x, y, sample):
    number = (y * np.uint32(SIDE) + x) * np.uint32(SPP) + sample
    steps = np.array([3242174889, 2447445414], np.uint32)
    return jnp.stack([(number * step >> np.uint32(8)).astype(jnp.float32) / 2**24 for step in steps], axis=-1)


class ByPlace:
    """The first coordinate that is asked for is always the same one."""

    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return in_type(good(x, y, sample)[..., : len(dims)], dtype)


@qj.pytree
@dataclass(frozen=True)
class Keyed:
    """Its key becomes an argument of programs, which NumPy cannot read."""

    key: int
    dims = 2

    def __call__(self, x, y, sample, dims, dtype):
        return in_type(good(x, y, sample ^ np.uint32(self.key))[..., list(dims)], dtype)


class Typed(Plug):
    """Made of a function of the requested coordinates and dtype, too."""

    def __call__(self, x, y, sample, dims, dtype):
        return self.made(x, y, sample, dims, dtype)


class Three(Typed):
    dims = 3


class Refusing(Plug):
    def check(self, width, height, spp):
        raise ValueError("spp must be 7")


CALLS = count()


def shifted(x, y, sample):
    return (good(x, y, sample) + (0.25 if x.ndim else 0)) % 1


def rough(x, y, sample):
    number = (y * np.uint32(SIDE) + x) * np.uint32(SPP) + sample
    return jnp.stack([to_unit(hash_word(number ^ np.uint32(seed))) for seed in (1, 2**20)], axis=-1)


def first_as(change, j=0):
    """Return a sampler of random points with one coordinate changed."""
    return Plug(lambda x, y, s: rough(x, y, s).at[..., j].set(change(rough(x, y, s)[..., j])))


def alone(wrong, kind=Typed):
    """Return a sampler that gives other points if just these coordinates are requested."""

    def points(x, y, sample, dims, dtype):
        made = jnp.concatenate([good(x, y, sample), good(y, x, sample)], axis=-1)[..., list(dims)]
        return in_type((made + 0.5) % 1 if dims == wrong else made, dtype)

    return kind(points)


def in_all_types(change):
    return Typed(lambda x, y, s, dims, dtype: change(good(x, y, s)[..., list(dims)], dtype))


def traced(x, y, sample):
    return good(x, y, sample) / (2 if isinstance(sample, jax.core.Tracer) else 1)


BREAKS = {
    "range": (Plug(lambda x, y, s: good(x, y, s) * 1.01), r"coordinate \d of pixel .* are in \[0, 1\)"),
    "one": (Plug(lambda x, y, s: jnp.where((s == 5)[..., None], 1, good(x, y, s))), "is 1.0: coordinates"),
    "nan": (Plug(lambda x, y, s: jnp.where((s == 3)[..., None], jnp.nan, good(x, y, s))), "sample 3, is nan"),
    "infinite": (first_as(lambda u: jnp.where(u < 0.1, jnp.inf, u)), "is inf: coordinates"),
    "repeats": (Plug(lambda x, y, s: good(x, y, s // 2)), "samples 0 and 1 of pixel .* are the same point"),
    "last repeats": (Plug(lambda x, y, s: good(x, y, jnp.minimum(s, 14))), "samples 14 and 15 of pixel"),
    "uniform": (Plug(lambda x, y, s: good(x, y, s) ** 2), "coordinate 0 is not uniform: its dis.* 0.25. off"),
    "second": (first_as(lambda u: u**1.2, 1), "coordinate 1 is not uniform"),
    "high half": (first_as(lambda u: (u + 1) / 2), "coordinate 0 is not uniform"),
    "gap": (first_as(lambda u: jnp.where(abs(u - 0.5) < 0.1, 0.3, u)), "coordinate 0 is not uniform"),
    "tent": (Plug(lambda x, y, s: (good(x, y, s) + good(y, x, s + 7)) / 2), "coordinate 1 is not uniform"),
    "coarse": (first_as(lambda u: jnp.floor(u**4 * 256) / 256), "0 is not uniform: its distribution is 0.4"),
    "constant": (first_as(lambda u: 0 * u + 0.25), "coordinate 0 is not uniform: it is 0.25 in all points"),
    "two values": (first_as(lambda u: jnp.where(u < 0.5, 0.1, 0.2)), "has only 2 values, from 0.1 to 0.2"),
    "rare": (first_as(lambda u: jnp.where(u < 0.1, 0.1, 0.6)), "its 2 values are not equally frequent"),
    "eight values": (first_as(lambda u: jnp.floor(u**2 * 8) / 8), "its 8 values are not equally frequent"),
    "ten values": (first_as(lambda u: jnp.floor(u * 10) / 20), "only 10 values, from 0 to 0.45"),
    "three values": (first_as(lambda u: jnp.floor(u * 3) / 4), "not one in each interval of 1/3"),
    "state": (Plug(lambda x, y, s: good(x, y, s) / 2 + next(CALLS) / 99), "a second call gives other points"),
    "traced": (Plug(traced), "jax.jit gives other points"),
    "company": (Plug(shifted), "one sample, 0 of pixel .* gives other points"),
    "dims": (ByPlace(), "coordinate 1 alone gives other points"),
    "first alone": (alone((0,)), "coordinate 0 alone gives other points"),
    "last alone": (alone((1,)), "coordinate 1 alone gives other points"),
    "middle alone": (alone((1,), Three), "coordinate 1 alone gives other points"),
    "turned": (alone((1, 0)), r"coordinates \(1, 0\) gives other points"),
    "all dims": (Typed(lambda x, y, s, dims, dtype: good(x, y, s).astype(dtype)), "0 alone (gives|fails)"),
    "float32": (in_all_types(lambda points, dtype: points), "dtype=float64 fails: .* float64 .* got float32"),
    "float16": (in_all_types(lambda points, dtype: points.astype(jnp.float16)), "float16"),
    "other in float64": (
        in_all_types(lambda points, dtype: in_type(points / (2 if dtype == jnp.float64 else 1), dtype)),
        "dtype=float64 gives other points",
    ),
    "integers": (Plug(lambda x, y, s: (4 * good(x, y, s)).astype(jnp.int32)), "with arrays .* fails|int"),
    "scalars": (Plug(lambda x, y, s: jnp.full(2, float(x) / 99)), "a call with arrays .* fails: TypeError"),
    "key": (Keyed(1), "jax.jit fails: TracerArrayConversionError"),
    "shape": (Plug(lambda x, y, s: good(x, y, s)[..., None]), "a call with arrays .* fails"),
    "arrays alone": (Plug(lambda x, y, s: good(x, y, s)[: x.shape[0]]), "one sample, .* fails"),
    "refuses": (Refusing(good), "it refuses 32 x 32 pixels with 16 samples: spp must be 7"),
}


@pytest.mark.parametrize("name", few(BREAKS, "nan", "coarse", "two values", "rare", "first alone", "float32"))
def test_a_broken_promise_is_told(name):
    sampler, sentence = BREAKS[name]
    broken = analysis.broken_promises(sampler, SIDE, SIDE, SPP)
    assert any(re.search(sentence, each) for each in broken), broken


OUTSIDE = {
    "equal coordinates": Plug(lambda x, y, s: good(x, y, s)[..., jnp.array([0, 0])]),
    "pixels that share points": Plug(lambda x, y, s: good(0 * x, 0 * y, s)),
    "two values, one in each half": first_as(lambda u: jnp.where(u < 0.5, 0.1, 0.6)),
    "a small bias": first_as(lambda u: u**1.02),
    "samples beyond those tested": Plug(lambda x, y, s: good(x, y, jnp.minimum(s, SPP))),
    "pixels beyond those tested": Plug(lambda x, y, s: jnp.where((x < SIDE)[..., None], good(x, y, s), 2)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE)
def test_what_is_no_promise_is_not_told(name):
    assert analysis.broken_promises(OUTSIDE[name], SIDE, SIDE, SPP) == []


LAWS = {
    "continuous": lambda u: u,
    "8 bits": lambda u: np.floor(u * 256) / 256,
    "quarters": lambda u: np.floor(u * 4) / 4 + 0.125,
    "thirds in float32": lambda u: np.float32(np.floor(u * 3)) / np.float32(3),
    "sets that pixels share": lambda u: u[:1] * np.ones_like(u),
    "a mask": lambda u: np.floor(u[:, :1] * 64) / 64 + 0 * u,
    "a shifted grid": lambda u: (u[:, :1] + np.arange(u.shape[1]) / u.shape[1]) % 1,
    "two samples in one": lambda u: u[:, np.arange(u.shape[1]) // 2],
    "a few sets": lambda u: u[np.arange(len(u)) % 7],
}


@pytest.mark.parametrize("law", LAWS)
def test_uniform_laws_are_not_told(law):
    """None of 100 keys, at a level of 1e-6."""
    for key in range(100):
        u = np.random.default_rng(key).random((256, 8))
        assert promises._not_uniform(LAWS[law](u).astype(float)) == "", key


def test_uniformity_is_tested_at_a_level_of_a_millionth():
    """By Kolmogorov's distribution, and by the probability that draws miss one of m values."""
    assert 5e-7 < stats.kstwobign.sf(promises._FAR) <= 1e-6
    for m, least in ((2, 0), (64, 5e-7), (1024, 5e-7)):
        draws = m * (np.log(m) + promises._UNSEEN)
        assert least < m * (1 - 1 / m) ** draws <= 1e-6


# A tile of a few points that are not in strata is not uniform itself.
def random_strata():
    return stratified(np.random.default_rng(1).random((32, 32, 1, 4, 2)))[:, :, 0]


OF_OURS = {
    "own": lambda: Plug(good),
    "screen": lambda: samplers.full_screen(sequences.sobol(4), SIDE, SIDE),
    "lattice in each pixel": lambda: samplers.independent(sequences.rank1_lattice(4), 1, "shift"),
    "tile": lambda: samplers.tiled(random_strata(), 3),
}
KEPT = SAMPLERS.without(["tiled, boxes"]) | Table(OF_OURS)


@pytest.mark.slow
@pytest.mark.parametrize("name", KEPT)
def test_samplers_keep_their_promises(name):
    assert analysis.broken_promises(KEPT[name], SIDE, SIDE, 4) == []


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
    made = {"Owen": owen, "Owen, other keys": other_owen, "fixed": KEPT["screen"]}
    made |= {"few": samplers.z(SIDE, SIDE, 4, 1), "deaf": lambda key: KEPT["screen"]}
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
        found = time_render(*rendering)
        seconds.append(found[0])
        while_timed.append(len(traces) - before)
        return found

    monkeypatch.setattr("analysis._comparing.compare.time_render", counted)
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
        "one": (lambda: Plug(later), r"sampler must return points in \[0, 1\), got .* in pixel \(40, 0"),
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
    def row(sampler, values):
        of, nothing = dict.fromkeys(("RMS error", "filtered error"), tuple(values)), np.zeros(1)
        return analysis.ComparisonRow("s", sampler, 1, of, 0.0, nothing, nothing, np.zeros((2, 2)))

    rows = row("best", [1.0, 1.1, 0.9, 1.0]), row("a", [2.0, 2.6, 2.2, 2.4]), row("b", [2.1, 2.5, 2.3, 2.4])
    left_out = {("s", "c", 1): "no", ("s", "c", 4): "no", ("t", "c", 4): "no"}
    compared = analysis.Comparison(rows, {}, {"a": ["one"]}, left_out, {})
    ranks = compared.ranks("s", 1)
    assert ranks["best"] == (1, 1, 1)
    assert sorted(rank for rank, _, _ in ranks.values()) == [1, 2, 3]
    assert ranks["a"][1:] == ranks["b"][1:] == (2, 3)
    said = str(compared).splitlines()
    assert " ".join(said[0].split()) == "RMS error 1 spp 4 spp"
    rows = [["best", "0.997*", "-"], ["a", "2.29", "-"], ["b", "2.32", "-"], ["c", "-", "-"], ["c", "-", "-"]]
    assert [line.split()[1:] for line in said[1:6]] == rows
    assert said[-2:] == ["left out: c, s at 1, 4 spp; t at 4 spp: no", "a breaks a promise: one"]


def test_further_measures_have_values_ranks_and_columns():
    """Of each key, as the function gives them."""
    measures = {"trimmed": analysis.trimmed_error, "own": lambda image, reference: np.ptp(image - reference)}
    made, worlds = {"Owen": owen}, {"disc": scenes.disc()}
    result = analysis.compare(made, worlds, [4], width=SIDE, height=SIDE, keys=4, measures=measures)
    exact, row = result.references["disc"], result.row("disc", "Owen", 4)
    images = [np.asarray(qj.render(scenes.disc(), owen(key), SIDE, SIDE, 4), np.float64) for key in range(4)]
    for name, of in measures.items():
        assert row.values[name] == tuple(of(image, exact) for image in images)
        assert result.ranks("disc", 4, name) == {"Owen": (1, 1, 1)} and name in str(result)
        assert result.table()[0][name] == row.mean(name) > result.table()[0][f"{name}, low"]


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
    own = np.asarray(KEPT["screen"](x, y, sample, (0, 1)), np.float64)
    whole = ((own + np.stack([x, y], axis=-1)) / 16).reshape(-1, 2)
    assert measured["star discrepancy"] == pytest.approx(analysis.star_discrepancy(whole), rel=1e-12)
    assert measured["largest t in a pixel"] == max(analysis.t_value(own[k // 4, k % 4]) for k in range(16))
    assert 0 < measured["relative minimum distance"] < 1


@pytest.mark.slow
def test_the_table_is_one_of_plain_values(comparison):
    table = comparison.table()
    assert len(table) == len(comparison.rows)
    assert {type(value) for row in table for value in row.values()} == {str, int, float}
    assert len({tuple(row) for row in table if row["spp"] > 1}) == 1
