"""The choice of a sampler: what the table says, in words and numbers, and that a new measurement agrees."""

import csv
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ttest_rel

import qmcjax as qj
from analysis.tables import make_recommendations
from qmcjax import choosing, samplers, scenes, sequences

TABLE = Path(choosing.__file__).parent / "_data" / "recommendations.csv"


def cell(smooth, level, spp, filtered):
    """Return errors by sampler and scene as the file has them, in thousandths."""
    with TABLE.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if line[0] != "#"))
    column = f"{choosing.MEASURES[filtered]} at {spp} spp"
    found = {}
    for row in rows:
        if int(row["level"]) == level and smooth in (None, row["kind"] == "smooth"):
            found.setdefault(row["sampler"], {})[row["scene"]] = int(row[column])
    return found


CELLS = list(product((None, True, False), choosing.LEVELS, choosing.SPPS, (False, True)))


def test_the_table_has_all_candidates_and_all_scenes():
    """Each sampler in all levels that it has the dimensions for, so that means are over the same scenes."""
    for level, of_level in make_recommendations.SCENES.items():
        assert all(len(scene.needs) <= level for scene in of_level.values())
        found = cell(None, level, 1, False)
        able = [name for name, made in choosing.CANDIDATES.items() if made.most_dims >= level]
        assert list(found) == able
        assert all(list(errors) == list(of_level) for errors in found.values())


def test_what_is_recommended_is_the_best_of_the_table():
    for smooth, level, spp, filtered in CELLS:
        found = cell(smooth, level, spp, filtered)
        means = {name: np.mean(list(errors.values())) for name, errors in found.items()}
        choice = qj.recommend(level, spp, smooth, filtered=filtered)
        assert means[choice.name] == min(means.values())
        assert set(choice.others) == set(means) - {choice.name}
        for name, other in choice.others.items():
            assert other.ratio == pytest.approx(np.exp((means[name] - means[choice.name]) / 1000))
        assert list(choice.others) == sorted(choice.others, key=means.__getitem__)


def test_intervals_are_those_of_paired_differences():
    found = cell(False, 4, 16, True)
    choice = qj.recommend(4, 16, False, filtered=True)
    for name, other in choice.others.items():
        pairs = [np.array(list(found[n].values())) / 1000 for n in (name, choice.name)]
        if np.ptp(pairs[0] - pairs[1]):
            interval = ttest_rel(*pairs).confidence_interval(0.95)
            np.testing.assert_allclose(np.log([other.low, other.high]), [interval.low, interval.high])


def test_no_difference_is_said():
    """One sample in each pixel has the same RMS error, wherever it is."""
    choice = qj.recommend(4, 1, smooth=False)
    assert "(0,2), Owen" in choice.alternatives and "no difference" in choice.reason
    for choice in (qj.recommend(2, 4, False, filtered=True), qj.recommend(8, 64, True)):
        differ = {name for name, other in choice.others.items() if other.low > 1.02}
        assert set(choice.alternatives) == set(choice.others) - differ
        assert (choice.margin is None) == (not differ)
        assert ("no difference" in choice.reason) == (len(choice.alternatives) > 0)
        assert choice.margin is None or str(choice.margin) in choice.reason


def test_the_type_of_a_scene_tells_its_kind():
    edges, smooth = scenes.disc(), scenes.gaussian()
    assert "scenes with edges in 2 dimensions" in qj.recommend(edges, 4).reason
    assert "smooth scenes in 2 dimensions" in qj.recommend(smooth, 4).reason
    assert "scenes with edges" in qj.recommend(smooth, 4, smooth=False).reason
    own = scenes.function(lambda point: point[..., 2], ("x", "y", "time"))
    assert " scenes in 3 or 4 dimensions" in qj.recommend(own, 4).reason
    assert qj.recommend(own, 4) == qj.recommend(("x", "y", "time"), 4) == qj.recommend(3, 4)
    assert qj.recommend(own, 4).others == qj.recommend(own, 4).others


def test_kinds_of_all_scenes_of_the_table_are_known():
    for of_level in make_recommendations.SCENES.values():
        kinds = [choosing.has_edges(scene) for scene in of_level.values()]
        assert None not in kinds and min(kinds.count(True), kinds.count(False)) >= 6


@pytest.mark.parametrize("spp", [1, 2, 3, 10, 64, 100, 2**31])
@pytest.mark.parametrize("dims", [2, 3, 5, 9, 250])
def test_there_is_an_answer_for_every_number(dims, spp):
    choice = qj.recommend(dims, spp)
    assert (choice.dims, choice.spp) == (dims, spp)
    able = choosing.CANDIDATES[choice.name]
    assert able.most_dims >= dims and not (able.powers_of_two and spp.bit_count() > 1)
    assert ("of more than 8 dimensions were not measured" in choice.reason) == (dims > 8)
    assert ("measured up to 64" in choice.reason) == (spp > 64)
    assert ("interpolated between" in choice.reason) == (spp in (2, 3, 10))


def test_between_the_numbers_of_samples_logarithms_are_interpolated():
    low, high, middle = (choosing.Measured.of(True, 4, spp, False) for spp in (4, 16, 8))
    for name, errors in middle.errors.items():
        np.testing.assert_allclose(errors, (low.errors[name] + high.errors[name]) / 2)


def test_what_is_recommended_can_be_rendered():
    scene = scenes.disc()
    sampler = qj.recommend(scene, 4, filtered=True).sampler(16, 8, 1)
    assert qj.render(scene, sampler, 16, 8, 4).shape == (8, 16)


@pytest.mark.slow
@pytest.mark.parametrize("name", choosing.CANDIDATES)
def test_candidates_have_the_dimensions_that_they_are_made_for(name):
    candidate = choosing.CANDIDATES[name]
    for dims in (2, 3, 4, 8):
        if candidate.takes(dims, 4):
            sampler = samplers.as_sampler("sampler", candidate.make(dims, 16, 8, 4, 1))
            assert sampler.dims >= dims
            sampler.check(16, 8, 4)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((1, 4), ValueError, r"needs must be an integer in \[2, 250\], got 1"),
        ((251, 4), ValueError, r"needs must be an integer in \[2, 250\], got 251"),
        ((2.0, 4), TypeError, "needs must be a scene, the names of its dimensions or how many there are"),
        (("x", 4), TypeError, "needs must be a scene"),
        ((("x",), 4), ValueError, r"needs must be an integer in \[2, 250\], got 1"),
        ((sequences.sobol(2), 4), TypeError, "needs must be a scene"),
        ((scenes.disc, 4), TypeError, "needs must be a scene"),
        ((2, 0), ValueError, r"spp must be an integer in \[1, "),
        ((2, 4, 1), TypeError, "smooth must be True or False, got 1"),
    ],
)
def test_errors(arguments, error, message):
    with pytest.raises(error, match=message):
        qj.recommend(*arguments)


def test_errors_of_keywords_and_sizes():
    with pytest.raises(TypeError, match="filtered must be True or False, got 'yes'"):
        qj.recommend(2, 4, filtered="yes")
    with pytest.raises(ValueError, match="width must be"):
        qj.recommend(2, 4).sampler(0, 8, 1)
    with pytest.raises(TypeError, match="key must be"):
        qj.recommend(2, 4).sampler(8, 8, "one")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["(0,2), Owen", "Z, hash", "Hilbert, Owen-Sobol'"])
def test_a_new_measurement_agrees(name):
    """With other keys: within 5 standard deviations of the mean over those, and the rounding."""
    level, spp, keys = 4, 4, range(100, 108)
    of = [
        np.square(make_recommendations.errors(choosing.CANDIDATES[each], level, spp, keys))
        for each in (name, "random")
    ]
    logarithm = 0.5 * np.log(of[0].mean(axis=-1) / of[1].mean(axis=-1))
    # Of the logarithm of a root of a mean over n keys.
    spread = [each.std(axis=-1, ddof=1) / each.mean(axis=-1) / 2 for each in of]
    deviation = np.hypot(*spread) * np.sqrt(1 / len(keys) + 1 / make_recommendations.KEYS)
    for measure, filtered in enumerate((False, True)):
        listed = np.array(list(cell(None, level, spp, filtered)[name].values())) / 1000
        assert (np.abs(logarithm[measure] - listed) < 5 * deviation[measure] + 0.001).all()


@pytest.mark.slow
def test_images_are_those_of_render():
    """The program behind the table evaluates all scenes at the points that an image would take."""
    candidate = choosing.CANDIDATES["(0,2), Owen"]
    side = make_recommendations.SIDE
    sampler = candidate.make(2, side, side, 4, 1)
    drawn = make_recommendations.images(sampler, 2, 4)
    names = list(make_recommendations.SCENES[2])
    expected = qj.render(scenes.gaussian(), sampler, side, side, 4)
    np.testing.assert_allclose(drawn[names.index("gaussian")], expected, atol=1e-5)


def test_images_that_are_too_large_for_a_net_are_told():
    choice = replace(qj.recommend(2, 64), name="permutation")
    assert choice.sampler(8192, 8192, key=1).dims == 2
    for spp, digits in ((64, 34), (32, 33)):
        choice = replace(choice, spp=spp)
        message = rf"width and height must .* got 8193 x 16 at {spp} spp, 2\*\*{digits}"
        with pytest.raises(ValueError, match=message):
            choice.sampler(8193, 16, key=1)
