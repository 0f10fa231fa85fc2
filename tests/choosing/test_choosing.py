"""The choice of a sampler: what the table says, in words and numbers, and that a new measurement agrees."""

import csv
from dataclasses import replace
from functools import cache, partial
from itertools import permutations, product
from pathlib import Path

import jax
import numpy as np
import pytest
from refusals import refused
from scipy.stats import ttest_1samp, ttest_rel
from tables import few, slow_cases

import qmcjax as qj
from analysis.tables import recommendations
from qmcjax import choosing, samplers, scenes

TABLES = Path(choosing.__file__).parent / "_data"
ARGUMENTS = {"images": {}, "frames": {"frames": 32}, "prefixes": {"progressive": True}}


@cache
def rows(file):
    with (TABLES / file).open(encoding="utf-8") as stream:
        return list(csv.DictReader(line for line in stream if line[0] != "#"))


def cell(smooth, level, spp, filtered, setting="images"):
    """Return errors by sampler, size and scene as the file has them, in thousandths."""
    column = f"{choosing.MEASURES[filtered]} at {spp} spp"
    found = {}
    for row in rows(choosing.SETTINGS[setting].file):
        if int(row["level"]) == level and smooth in (None, row["kind"] == "smooth"):
            found.setdefault(row["sampler"], {})[row["size"], row["scene"]] = int(row[column])
    return found


CELLS = [
    (setting, *rest)
    for setting, of in choosing.SETTINGS.items()
    for rest in product((None, True, False), choosing.LEVELS, of.spps, (False, True))
]


@pytest.mark.parametrize("setting", choosing.SETTINGS)
def test_the_tables_have_all_candidates_and_all_scenes(setting):
    """Each sampler in all levels that it has the dimensions for, so that means are over the same scenes."""
    of_setting = choosing.SETTINGS[setting]
    sizes = ["{} x {}".format(*size) for size in of_setting.sizes]
    (side, same), (width, height) = of_setting.sizes
    assert side == same and side.bit_count() == 1 and width.bit_count() > 1 and height.bit_count() > 1
    for level, of_level in recommendations.SCENES.items():
        assert all(len(scene.needs) <= level for scene in of_level.values())
        found = cell(None, level, 1, False, setting)
        able = [k for k, made in of_setting.candidates.items() if made.least_dims <= level <= made.most_dims]
        assert list(found) == able
        assert all(list(errors) == list(product(sizes, of_level)) for errors in found.values())


def words(choice):
    """Return the reason in one line."""
    return " ".join(choice.reason.split())


def test_what_is_recommended_is_the_best_of_the_table():
    """With its ratios to the others, and as its cost the largest ratio on a single scene."""
    for setting, smooth, level, spp, filtered in CELLS:
        found = cell(smooth, level, spp, filtered, setting)
        means = {name: np.mean(list(errors.values())) for name, errors in found.items()}
        choice = qj.recommend(level, spp, smooth, filtered=filtered, **ARGUMENTS[setting])
        assert choice.setting == setting
        assert means[choice.name] == min(means.values())
        assert set(choice.others) == set(means) - {choice.name}
        for name, other in choice.others.items():
            assert other.ratio == pytest.approx(np.exp((means[name] - means[choice.name]) / 1000))
        assert list(choice.others) == sorted(choice.others, key=means.__getitem__)
        # The reason is two sentences in lines of 80 characters.
        assert max(map(len, str(choice).split("\n"))) <= 80
        assert words(choice).replace("... ", "").count(". ") == 1 and words(choice).endswith(".")
        assert str(choice).startswith(f"{choice.name}\n{choice.reason}\n")
        # A zone plate is smooth, and no sampler is better on it at few samples, whatever it is on others.
        errors = np.array([list(of.values()) for of in found.values()]) / 1000
        own = errors[list(found).index(choice.name)]
        assert choice.cost == pytest.approx(np.exp((own - errors.min(axis=0)).max()))
        assert f"at most {choice.cost:.2f} times" in " ".join(str(choice).split())


def logarithms(found, names):
    """Return errors as they are in the table, shape (samplers, sizes, scenes)."""
    return np.array([list(found[name].values()) for name in names]).reshape(len(names), 2, -1) / 1000


@pytest.mark.parametrize(("level", "filtered"), [(4, True), (2, False)])
def test_intervals_are_those_of_paired_differences(level, filtered):
    """By scipy: at each size, with the level at which Holm's procedure ends for all pairs of samplers."""
    choice = qj.recommend(level, 16, False, filtered=filtered)
    errors = logarithms(cell(False, level, 16, filtered), [choice.name, *choice.others])
    pairs = np.array(list(permutations(errors, 2)))
    above = pairs[:, 0] - pairs[:, 1] - np.log(1.02)
    p = 2 * ttest_1samp(above, 0, axis=-1, alternative="greater").pvalue.max(axis=-1)
    # The two directions of a pair: the second is far from certain.
    p = np.sort(p)[: len(p) // 2]
    passed = p <= 0.05 / np.arange(len(p), 0, -1)
    left = len(p) - (len(p) if passed.all() else int(np.argmin(passed)))
    for k, other in enumerate(choice.others.values(), start=1):
        intervals = ttest_rel(errors[k], errors[0], axis=-1).confidence_interval(1 - 0.05 / max(1, left))
        np.testing.assert_allclose(np.log(other.low), intervals.low.min(), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(np.log(other.high), intervals.high.max(), rtol=1e-9, atol=1e-12)
    assert left > 1


def test_reasons_say_what_is_significant():
    """One sample in each pixel has the same RMS error, wherever it is."""
    none = qj.recommend(4, 1, smooth=False)
    assert "(0,2), Owen" in none.alternatives and none.margin is None
    assert words(none).endswith(". No difference to another sampler is significant.")
    for choice in (none, qj.recommend(2, 4, False, filtered=True), qj.recommend(8, 64, True)):
        differ = [name for name, other in choice.others.items() if other.low > 1.02]
        assert set(choice.alternatives) == set(choice.others) - set(differ)
        assert (choice.margin is None) == (not differ)
        assert (f"{len(choice.alternatives)} other" in words(choice)) == bool(choice.alternatives and differ)
        if differ:
            of = choice.margin
            said = f'"{differ[0]}" has {of.ratio:.2f} times this error ({of.low:.2f} to {of.high:.2f})'
            assert said in words(choice)


@pytest.mark.parametrize("setting", choosing.SETTINGS)
@pytest.mark.parametrize("filtered", [False, True])
def test_the_safest_sampler_has_the_least_worst_case(setting, filtered):
    of = choosing.SETTINGS[setting]
    worst = {}
    for smooth, level, spp in product((True, False), choosing.LEVELS, of.spps):
        means = {
            name: np.mean(list(errors.values())) / 1000
            for name, errors in cell(smooth, level, spp, filtered, setting).items()
        }
        for name, mean in means.items():
            worst.setdefault(name, []).append(np.exp(mean - min(means.values())))
    full = {name: max(ratios) for name, ratios in worst.items() if len(ratios) == 6 * len(of.spps)}
    found = choosing.worst_cases(filtered, of)
    assert list(found) == sorted(full, key=full.__getitem__)
    for name, (ratio, where) in found.items():
        assert ratio == pytest.approx(full[name]) and " dimensions at " in where


def test_the_type_of_a_scene_tells_its_kind():
    edges, smooth = scenes.disc(), scenes.gaussian()
    assert "scenes with edges in 2 dimensions" in words(qj.recommend(edges, 4))
    assert "smooth scenes in 2 dimensions" in words(qj.recommend(smooth, 4))
    assert "scenes with edges" in words(qj.recommend(smooth, 4, smooth=False))
    own = scenes.function(lambda point: point[..., 2], ("x", "y", "time"))
    assert " scenes in 3 or 4 dimensions" in words(qj.recommend(own, 4))
    assert qj.recommend(own, 4) == qj.recommend(("x", "y", "time"), 4) == qj.recommend(3, 4)
    assert qj.recommend(own, 4).others == qj.recommend(own, 4).others


def test_traced_scenes_have_edges():
    assert choosing.has_edges(scenes.cornell_box()) is True
    said = words(qj.recommend(scenes.occluder(), 4))
    assert "scenes with edges" in said and said.endswith(" None of these scenes is ray-traced.")
    for given in ({"needs": scenes.ball()}, {"needs": scenes.occluder(), "after": "denoiser"}):
        assert "ray-traced" not in words(qj.recommend(spp=4, **given))


@pytest.mark.parametrize("name", choosing.CANDIDATES)
def test_each_key_makes_another_sampler(name):
    """By arrays of the same pytree, so that one program serves all."""
    made = [choosing.CANDIDATES[name].make(2, 16, 8, 4, key) for key in (1, 2)]
    assert jax.tree.structure(made[0]) == jax.tree.structure(made[1])
    leaves = zip(*map(jax.tree.leaves, made), strict=True)
    assert not all(np.array_equal(*of) for of in leaves)


PIXELS = np.uint32([3, 9]), np.uint32([5, 2]), np.uint32([1, 3])


# LLVM takes half of the time without optimisation, and few points are drawn.
@partial(jax.jit, static_argnames="dims", compiler_options={"xla_backend_optimization_level": 0})
def drawn(sampler, x, y, sample, dims=(0, 1)):
    return sampler(x, y, sample, dims)


def test_kinds_of_all_scenes_of_the_table_are_known():
    for of_level in recommendations.SCENES.values():
        kinds = [choosing.has_edges(scene) for scene in of_level.values()]
        assert None not in kinds and min(kinds.count(True), kinds.count(False)) >= 6


@pytest.mark.parametrize("spp", [1, 2, 3, 10, 64, 100, 2**31])
@pytest.mark.parametrize("dims", [2, 3, 5, 9, 250])
def test_there_is_an_answer_for_every_number(dims, spp):
    choice = qj.recommend(dims, spp)
    assert (choice.dims, choice.spp) == (dims, spp)
    able = choosing.CANDIDATES[choice.name]
    assert able.least_dims <= dims <= able.most_dims and not (able.powers_of_two and spp.bit_count() > 1)
    assert ("5 to 8 dimensions (more were not measured)" in words(choice)) == (dims > 8)
    assert ("measured up to 64" in words(choice)) == (spp > 64)
    assert ("interpolated between" in words(choice)) == (spp in (2, 3, 10))


def test_between_the_numbers_of_samples_logarithms_are_interpolated():
    low, high, middle = (choosing.Measured.of(True, 4, spp, False) for spp in (4, 16, 8))
    for name, errors in middle.errors.items():
        np.testing.assert_allclose(errors, (low.errors[name] + high.errors[name]) / 2)


def test_what_is_recommended_can_be_rendered():
    scene = scenes.disc()
    sampler = qj.recommend(scene, 4, filtered=True).sampler(16, 8, 1)
    assert qj.render(scene, sampler, 16, 8, 4).shape == (8, 16)


RENDERED = [("prefixes", name, 2) for name in choosing.SETTINGS["prefixes"].candidates]
RENDERED += slow_cases(*(("images", name, 8) for name in choosing.CANDIDATES))


@pytest.mark.parametrize("setting, name, rendered", RENDERED)
def test_candidates_have_the_dimensions_that_they_are_made_for(setting, name, rendered):
    """And those of progressive images render prefixes."""
    candidate = choosing.SETTINGS[setting].candidates[name]
    for dims in (2, 4, 8):
        if candidate.takes(dims, 8):
            sampler = samplers.as_sampler("sampler", candidate.make(dims, 16, 8, 8, 1))
            assert sampler.dims >= dims
            sampler.check(16, 8, rendered)


REMEASURED = [
    ("images", "(0,2), Owen"), ("images", "Z, hash"), ("images", "Hilbert, Owen-Sobol'"),
    ("frames", "Hilbert, golden shifts"), ("frames", "designed frames"), ("frames", "Z, moving"),
    ("prefixes", "optimised orders"), ("prefixes", "designed, progressive"),
    ("prefixes", "progressive orders"),
]  # fmt: skip


@cache
def measured(setting, name):
    """Return logarithms of errors of a candidate at 4 spp in 4 dimensions, in the second size."""
    of, (_, size) = choosing.SETTINGS[setting], choosing.SETTINGS[setting].sizes
    errors = recommendations.errors(of.candidates[name], of, 4, size, 4, range(of.keys))
    return recommendations.logarithm(errors)


@pytest.mark.slow
@pytest.mark.parametrize(("setting", "name"), REMEASURED)
def test_a_new_measurement_agrees(setting, name):
    """With the same keys, to the last digit: whoever changes a sampler's bits measures anew."""
    found = measured(setting, name) - measured(setting, "random")
    for measure, filtered in enumerate((False, True)):
        listed = logarithms(cell(None, 4, 4, filtered, setting), [name])[0, 1]
        np.testing.assert_allclose(found[measure], listed, atol=0.0011)


def test_images_that_are_too_large_for_a_net_are_told():
    choice = replace(qj.recommend(2, 64), name="permutation")
    assert choice.sampler(8192, 8192, key=1).dims == 2
    for spp, digits in ((64, 34), (32, 33)):
        choice = replace(choice, spp=spp)
        message = rf"width and height must .* got 8193 x 16 at {spp} spp, 2\*\*{digits}"
        with pytest.raises(ValueError, match=message):
            choice.sampler(8193, 16, key=1)


# -- animations, progressive images, sizes


FRAMES = choosing.SETTINGS["frames"].candidates


@pytest.mark.parametrize("name", few(FRAMES, "Hilbert, moving", "designed frames"))
def test_frames_are_the_same_program_with_other_points(name):
    """Frames of a key differ, and a traced number of a frame gives the sampler of that frame."""
    candidate = choosing.SETTINGS["frames"].candidates[name]
    made = [candidate.make(4, 16, 8, 4, 1, np.uint32(t)) for t in (3, 4)]
    assert jax.tree.structure(made[0]) == jax.tree.structure(made[1])
    at = *PIXELS, (0, 1, 2, 3)
    first, second = (np.asarray(drawn(sampler, *at)) for sampler in made)
    assert (first != second).any(axis=0).all()
    traced = jax.jit(lambda t: candidate.make(4, 16, 8, 4, 1, t))(np.uint32(4))
    np.testing.assert_allclose(drawn(traced, *at), second, atol=2e-7)


def test_what_is_recommended_for_frames_is_a_sampler_of_each():
    choice = qj.recommend(2, 4, filtered=True, frames=32)
    sampler = choice.sampler(16, 8, 1, frame=5)
    expected = choosing.SETTINGS["frames"].candidates[choice.name].make(2, 16, 8, 4, jax.random.key(1), 5)
    assert np.array_equal(sampler(*PIXELS), expected(*PIXELS))
    assert "filtered error of a moving average over 32 frames" in words(choice)
    assert qj.recommend(2, 4, frames=7) == qj.recommend(2, 4, frames=32)
    assert "measured up to 4" in words(qj.recommend(2, 16, frames=2))
    fresh = choosing.SETTINGS["frames"].candidates["Z, new keys"]
    assert fresh.takes(2, 4) and not fresh.takes(2, 3)


def test_what_is_recommended_for_prefixes_is_a_sampler():
    choice = qj.recommend(3, 16, progressive=True)
    assert choice.sampler(16, 8, 1)(1, 2, 3, dims=(0, 1, 2)).shape == (3,)
    assert "on average over the first 1, 2, 4, ... samples" in words(choice)


@pytest.mark.parametrize(("size", "place"), [((512, 512), 0), (np.array([512, 256]), 1), ([500, 500], 1)])
def test_only_images_like_the_size_count(size, place):
    choice = qj.recommend(2, 16, True, size=size)
    names = [choice.name, *choice.others]
    errors = logarithms(cell(True, 2, 16, False), names)[:, place].mean(axis=1)
    assert errors[0] == errors.min() and (np.diff(errors) >= 0).all()
    ratios = [1, *(other.ratio for other in choice.others.values())]
    np.testing.assert_allclose(ratios, np.exp(errors - errors[0]))


@pytest.mark.slow
def test_prefixes_are_means_of_logarithms_over_powers_of_two():
    """Of images of the first samples, by render."""
    candidate, size = choosing.SETTINGS["prefixes"].candidates["(0,2), Owen"], (12, 10)
    of = recommendations.errors(candidate, choosing.SHOWN, 2, size, 4, range(1, 2))
    place = list(recommendations.SCENES[2]).index("gaussian")
    scene, sampler = scenes.gaussian(), candidate.make(2, *size, 4, 1)
    exact, _ = scene.reference(*size)
    for k, count in enumerate((1, 2, 4)):
        image = np.asarray(qj.render(scene, sampler, *size, count))
        assert of[k, 0, place, 0] == pytest.approx(np.sqrt(np.mean((image - exact) ** 2)), rel=1e-4)
    mean = np.log(of[:, 0, place, 0]).mean()
    assert recommendations.logarithm(of)[0, place] == pytest.approx(mean)


def test_the_moving_average_forgets():
    """After many rounds of the frames it is what the recursion reaches; a constant stays."""
    frames = np.random.default_rng(1).random((8, 2, 3))
    average = np.zeros((2, 3))
    for _ in range(40):
        reached = []
        for frame in frames:
            average = (1 - recommendations.ALPHA) * average + recommendations.ALPHA * frame
            reached.append(average)
    # Weights beyond six rounds are left out: 0.9**48 of them.
    np.testing.assert_allclose(recommendations.moving_average(frames), reached, atol=0.9**48)
    np.testing.assert_allclose(recommendations.moving_average(np.full((32, 1, 1), 3.0)), 3.0)


test_bad_input_is_named = refused(
    (lambda: qj.recommend(2, 4, frames=2, progressive=True), "progressive must be False for"),
    (lambda: qj.recommend(2, 4, frames=2).sampler(16, 16, 1), "frame must be the number of a frame, got"),
    error=ValueError,
)


def test_after_a_denoiser_the_stored_errors_decide():
    """Also for numbers of samples and dimensions that were not measured."""
    table = rows(choosing.DENOISED.file)
    assert {row["sampler"] for row in table} == set(choosing.DENOISED.candidates)
    for level, spp in product(choosing.LEVELS, choosing.DENOISED.spps):
        found = {}
        for row in table:
            if int(row["level"]) == level:
                found.setdefault(row["sampler"], []).append(int(row[f"RMS error at {spp} spp"]))
        choice = qj.recommend(level, spp, after="denoiser")
        assert choice.setting == "denoised" and "error after Open Image Denoise" in words(choice)
        means = {name: np.mean(of) for name, of in found.items()}
        assert means[choice.name] == min(means.values()) and choice.others.keys() < means.keys()
        assert {len(of) for of in found.values()} == {len(found["random"])}
    for dims, spp in product((2, 5, 250), (3, 64, 2**17, 2**31)):
        choice = qj.recommend(dims, spp, after="denoiser", size=(100, 76))
        assert choice.sampler(16, 8, 1).dims >= dims


def test_a_filter_is_what_filtered_says():
    assert qj.recommend(4, 4, after="filter") == qj.recommend(4, 4, filtered=True)
    assert qj.recommend(4, 4, frames=8, after="nothing") == qj.recommend(4, 4, frames=8)


test_what_cannot_come_after = refused(
    (lambda: qj.recommend(4, 4, after=True), TypeError, "after must be one of"),
    (lambda: qj.recommend(4, 4, filtered=True, after="filter"), ValueError, "filtered must be False with"),
    (lambda: qj.recommend(4, 4, frames=8, after="denoiser"), ValueError, "after must be .* for frames"),
    (lambda: qj.recommend(4, 4, progressive=True, after="denoiser"), ValueError, "after must be"),
)
