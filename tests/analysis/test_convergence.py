import math
from dataclasses import dataclass

import numpy as np
import pytest
from refusals import refused
from scipy import stats

import analysis._comparing.convergence
import qmcjax as qj
from analysis import ConvergenceRow, ConvergenceTable, convergence
from qmcjax import samplers, scenes, sequences
from qmcjax.core import checkpoints


@dataclass(frozen=True)
class Fake:
    """Predicts its error: factor * spp^exponent, and ten times as much from row 4 on."""

    factor: float
    exponent: float
    made_for: int | None = None

    dims = 2

    def __call__(self, x, y, sample, dims):
        raise AssertionError

    def check(self, width, height, spp):
        if self.made_for not in (None, spp):
            raise ValueError(f"spp must be {self.made_for}, got {spp}")


class Scene:
    """Its reference is a ramp; references that were asked for are counted."""

    needs = ("x", "y")

    def __init__(self):
        self.asked = []

    def __call__(self, point):
        raise AssertionError

    def reference(self, width, height):
        self.asked.append((width, height))
        return np.linspace(0, 1, width * height).reshape(height, width), 1e-10


@pytest.fixture
def rendered(monkeypatch):
    """Replace the renderer by an error of alternating sign, and the clock by one of steps 10, 1, 2, 9."""
    calls = []
    clock = [0.0]

    class Pending(np.ndarray):
        def block_until_ready(self):
            clock[0] += [10.0, 1.0, 2.0, 9.0][(len(calls) - 1) % 4]
            return self

    def render(scene, sampler, width, height, spp, mesh):
        calls.append((sampler, width, height, spp))
        sign = 1 - 2 * (np.indices((height, width)).sum(axis=0) % 2)
        size = np.where(np.arange(height) < 4, 1.0, 10.0)[:, None]
        reference, _ = Scene().reference(width, height)
        fake = sampler.sampler
        return (reference + sign * size * fake.factor * spp**fake.exponent).view(Pending)

    monkeypatch.setattr(analysis._comparing.convergence, "render", render)
    monkeypatch.setattr(analysis._comparing.convergence.time, "perf_counter", lambda: clock[0])
    return calls


SAMPLERS = {"slow": Fake(0.5, -0.5), "fast": lambda spp: Fake(2.0, -1.5, made_for=spp)}


def test_table(rendered):
    """Rows in order, errors of the regions as they were put, exponents as slopes."""
    scene = Scene()
    table = convergence(scene, SAMPLERS, [1, 4, 16], width=6, height=8)
    assert [(row.sampler, row.spp) for row in table.rows] == [(n, s) for n in SAMPLERS for s in (1, 4, 16)]
    assert scene.asked == [(6, 8)]
    assert table.bound == 1e-10
    said = [line.split() for line in str(table).splitlines()]
    assert said[0] == ["sampler", "spp", "whole", "upper", "lower", "seconds"] and len(said) == 2 + 6
    assert said[1][:4] == ["slow", "1", f"{table.rows[0].errors['whole']:.3g}", "0.5"]
    for name, factor, exponent in [("slow", 0.5, -0.5), ("fast", 2.0, -1.5)]:
        for region, more in [("upper", 1.0), ("lower", 10.0), ("whole", math.sqrt(50.5))]:
            spps, errors = table.errors(name, region)
            np.testing.assert_array_equal(spps, [1, 4, 16])
            np.testing.assert_allclose(errors, more * factor * spps.astype(float) ** exponent, rtol=1e-12)
            assert table.slope(name, region) == pytest.approx(exponent, rel=1e-12)


def test_times(rendered):
    """The first of four renderings is kept apart; the median of 1, 2, 9 is 2."""
    table = convergence(Scene(), SAMPLERS, [1, 2], width=6, height=8, repeats=3)
    assert all((row.first_seconds, row.seconds) == (10.0, 2.0) for row in table.rows)
    assert len(rendered) == 4 * 4
    assert all(call[1:3] == (6, 8) for call in rendered)


def test_regions(rendered):
    """Any index of numpy: rows and columns, a mask; and the halves of an odd height."""
    mask = np.zeros((8, 6), bool)
    mask[3:5, 2] = True
    regions = {"corner": np.s_[:2, :3], "mask": mask}
    table = convergence(Scene(), {"a": Fake(1.0, 0.0)}, [1], width=6, height=8, regions=regions)
    assert table.rows[0].errors == pytest.approx({"corner": 1.0, "mask": math.sqrt(50.5)})
    odd = convergence(Scene(), {"a": Fake(1.0, 0.0)}, [1], width=6, height=7)
    assert odd.rows[0].errors["upper"] == pytest.approx(1.0)
    assert odd.rows[0].errors["lower"] == pytest.approx(math.sqrt((1 + 3 * 100) / 4))


def test_an_interrupted_sweep_goes_on(rendered, tmp_path, monkeypatch):
    """What was measured is neither measured again nor lost, and no other sweep takes it for its own."""
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)
    monkeypatch.setattr(checkpoints, "SHARE", math.inf)
    kept = qj.Checkpoint(tmp_path / "sweep", "v1")
    given = {"width": 6, "height": 8, "reference": Scene().reference(6, 8), "checkpoint": kept}

    def stop(part):
        if part == 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        convergence(scenes.disc(), SAMPLERS, [1, 4], progress=stop, **given)
    assert len(rendered) == 2 * 4
    parts = []
    table = convergence(scenes.disc(), SAMPLERS, [1, 4], progress=parts.append, **given)
    assert (len(rendered), parts) == (4 * 4, [0.75, 1.0])
    assert convergence(scenes.disc(), SAMPLERS, [1, 4], **given) == table
    assert len(rendered) == 4 * 4
    assert convergence(scenes.disc(), SAMPLERS, [1, 4], **{**given, "checkpoint": None}) == table
    with pytest.raises(ValueError, match=r"^checkpoint .*sweep', where samplers is another one: "):
        convergence(scenes.disc(), SAMPLERS, [1, 16], **given)
    with pytest.raises(ValueError, match=r"label where foreign .* and samplers: test_convergence\.Fake:"):
        convergence(scenes.disc(), SAMPLERS, [1, 4], **{**given, "checkpoint": tmp_path / "plain"})


GOOD = {"samplers": SAMPLERS, "spps": [1, 4], "width": 8, "height": 8}
BAD = [
    (dict(samplers={"net": Fake(1.0, 0.0, made_for=4)}), "spp must be 4, got 1"),
    (dict(samplers={"good": SAMPLERS["slow"], "none": lambda spp: None}), r"samplers\['none'\].*None"),
    (dict(regions={"nothing": np.s_[8:]}), r"regions\['nothing'\]"),
    (dict(height=1), r"regions\['upper'\]"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_refused_before_anything_is_computed(rendered, change, message):
    scene = Scene()
    with pytest.raises((TypeError, ValueError), match=message):
        convergence(scene, **{**GOOD, **change})
    assert not rendered and not scene.asked


def test_a_reference_is_given(rendered):
    """In place of the scene's own, which it then need not have; bounds of many values, too."""
    image, _ = Scene().reference(8, 8)
    scene = scenes.function(lambda point: point[..., 0], ("x", "y"))
    table = convergence(scene, SAMPLERS, [1, 4], width=8, height=8, reference=(image, np.eye(8) / 64))
    assert table.bound == 1 / 64
    assert table.errors("slow", "upper")[1].tolist() == pytest.approx([0.5, 0.25])


def test_an_estimated_reference():
    """Of one sample of a ramp: up to the bound, its offset from the pixel's middle."""
    scene = scenes.function(lambda point: point[..., 0], ("x", "y"))
    reference = qj.estimated_reference(scene, 8, 8, 4096, key=1)
    jittered = samplers.independent(sequences.sobol(2), key=2)
    table = convergence(scene, {"a": jittered}, [1], width=8, height=8, repeats=1, reference=reference)
    y, x = np.indices((8, 8)).astype(np.uint32)
    offsets = np.asarray(jittered(x, y, 0 * x))[..., 0] - 0.5
    assert abs(table.errors("a")[1][0] - np.sqrt(np.mean(offsets**2)) / 8) <= table.bound
    assert table.bound == reference[1] < 1e-3


def scene_with(reference):
    class Referenced(Scene):
        pass

    Referenced.reference = reference
    return Referenced()


test_what_is_wrong_with_a_scenes_reference = refused(
    (scenes.function(lambda p: p[..., 0], ("x", "y")), "scene must have a ref.*estimated_ref"),
    (scene_with(lambda *_: None), r"scene.reference\(width, height\) must be a pair"),
    (scene_with(lambda *_: (np.zeros(8), 0)), r"scene.reference.*\[0\] must have shape \(8, 8\)"),
    call=lambda scene: convergence(scene, **GOOD),
)


def table_of(errors):
    """Return a table of errors of 1, 2, 4, ... samples."""
    rows = (ConvergenceRow("a", 2**k, {"whole": float(e)}, 0.5, 1.0) for k, e in enumerate(errors))
    return ConvergenceTable(tuple(rows), 0.0)


def scattered(exponent, scatter, seed, count=10):
    """Return a table whose errors are a power of spp times log-normal noise."""
    noise = np.exp(scatter * np.random.default_rng(seed).normal(size=count))
    return table_of(2.0 ** (exponent * np.arange(count)) * noise)


def test_the_slopes_interval_is_that_of_scipy():
    table = scattered(-0.7, 0.2, seed=1)
    spps, errors = table.errors("a")
    line = stats.linregress(np.log(spps), np.log(errors))
    expected = stats.t.interval(0.9, len(spps) - 2, line.slope, line.stderr)
    assert table.slope_interval("a", level=0.9) == pytest.approx(expected, rel=1e-12)


def test_an_exact_power_has_an_interval_of_no_length():
    table = scattered(-1.5, 0.0, seed=0)
    assert table.slope_interval("a") == table.slope_interval("a") == pytest.approx((-1.5, -1.5))
    np.testing.assert_allclose(scattered(-0.5, 0.0, seed=0).efficiency("a"), 2.0 * 2 ** np.arange(10))


test_what_a_table_cannot_tell = refused(
    (lambda table: table.slope_interval("a", level=1.0), r"level must be in \(0, 1\), got 1.0"),
    (lambda _: table_of([1.0]).errors("b"), r"sampler must be one of \['a'\], got 'b'"),
    (lambda _: table_of([1.0]).errors("a", "left"), r"region must be one of \['whole'\], got 'left'"),
    (lambda _: table_of([1.0]).slope("a"), "'a'"),
    (lambda _: table_of([1.0, 0.0]).slope("a"), "'a'"),
    (lambda table: scattered(-1, 0.1, 0, count=2).slope_interval("a"), "three or more errors"),
    call=lambda call: call(scattered(-0.5, 0.1, seed=0)),
    error=ValueError,
)


def over_keys(errors, spps=(1, 4, 16)):
    """Return a table of errors, shape (numbers of samples, keys)."""
    rows = (
        ConvergenceRow("a", n, {"whole": float(np.exp(np.log(of).mean()))}, 1.0, 1.0, {"whole": tuple(of)})
        for n, of in zip(spps, errors, strict=True)
    )
    return ConvergenceTable(tuple(rows), 0.0)


def test_intervals_over_keys_are_those_of_scipy():
    """Of logarithms of errors, and of the slopes of the keys; the slope is that of the geometric means."""
    errors = np.array([1.0, 0.4, 0.1])[:, None] * np.exp(0.1 * np.random.default_rng(2).normal(size=(3, 6)))
    table = over_keys(errors)
    for row, of in zip(table.rows, np.log(errors), strict=True):
        expected = stats.t.interval(0.9, 5, of.mean(), stats.sem(of))
        assert np.log(row.interval(level=0.9)) == pytest.approx(expected, rel=1e-12)
    assert np.array_equal(table.bands("a", level=0.9).T, [row.interval(level=0.9) for row in table.rows])
    slopes = [np.polyfit(np.log([1, 4, 16]), of, 1)[0] for of in np.log(errors).T]
    assert table.slope("a") == pytest.approx(np.mean(slopes), rel=1e-10)
    expected = stats.t.interval(0.95, 5, np.mean(slopes), stats.sem(slopes))
    assert table.slope_interval("a") == pytest.approx(expected, rel=1e-10)
    assert "a  " in str(table) and f"{table.slope('a'):.2f} ±" in str(table) and "over 6 keys" in str(table)
    assert over_keys(errors[:2], (1, 4)).slope_interval("a")[0] < -0.5


def test_fewer_than_4_keys_have_no_intervals():
    table = over_keys(np.array([[1.0, 1.1, 0.9], [0.5, 0.4, 0.6], [0.2, 0.3, 0.25]]))
    assert table.rows[0].interval() == (0, np.inf)
    spps, errors = table.errors("a")
    line = stats.linregress(np.log(spps), np.log(errors))
    width = stats.t.ppf(0.975, 1) * line.stderr
    assert table.slope_interval("a") == pytest.approx((line.slope - width, line.slope + width), rel=1e-10)
    assert "%" not in str(table).partition("\n±")[0]


def test_each_key_is_a_rendering(rendered):
    """Factors of keys 0 to 3 are 1, 2, 4 and 8; what takes no key is rendered once, as is a single image."""
    made = {"keyed": lambda spp, key: Fake(2.0**key, -1.0), "deaf": lambda key: Fake(1.0, -0.5)}
    made["fixed"] = Fake(1.0, -0.5)
    table = convergence(Scene(), made, [1, 4], width=6, height=8, keys=4, repeats=1)
    assert len(rendered) == 2 * (5 + 5 + 2)
    row = table.rows[1]
    assert (row.sampler, row.spp) == ("keyed", 4)
    assert row.values["upper"] == pytest.approx([0.25, 0.5, 1, 2])
    errors = np.array([row.errors["upper"], row.errors["lower"]])
    assert errors == pytest.approx([np.sqrt(0.5), 10 * np.sqrt(0.5)])
    assert all(len(row.values["whole"]) == 1 for row in table.rows[2:])
    assert table.slope_interval("keyed") == pytest.approx((-1, -1))
    lines = str(table).splitlines()
    assert len(lines) == 1 + 3 * 3 + 1 and lines[1].split()[:2] == ["whole", "keyed"]
    with pytest.raises(TypeError, match=r"samplers\['a'\] must be a function with parameters among width"):
        convergence(Scene(), {"a": lambda n: Fake(1.0, 0.0)}, [1], width=6, height=8, keys=4)


def test_keys_in_a_checkpoint(rendered, tmp_path):
    """The same table again, and none without keys."""
    given = {"width": 6, "height": 8, "reference": Scene().reference(6, 8)}
    given["checkpoint"] = qj.Checkpoint(tmp_path / "sweep", "v1")
    made = {"a": lambda key: Fake(2.0**key, -1.0)}
    table = convergence(scenes.disc(), made, [1, 4], keys=4, **given)
    count = len(rendered)
    assert convergence(scenes.disc(), made, [1, 4], keys=4, **given) == table and len(rendered) == count
    with pytest.raises(ValueError, match=r"where samplers is another one"):
        convergence(scenes.disc(), made, [1, 4], keys=5, **given)
