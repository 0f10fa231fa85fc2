"""Point generators of other libraries as sequences, and ours as engines of scipy, with scipy's own tests."""

from types import SimpleNamespace

import numpy as np
import pytest
import tables
from refusals import refused
from scipy.integrate import qmc_quad
from scipy.stats import qmc
from scipy.stats.tests import test_qmc

import analysis
from qmcjax import sequences
from qmcjax.bridges import SequenceEngine, tabulate

SOBOL = sequences.sobol(3)


def replicated(points):
    """Return what is asked of a discrete distribution of QMCPy."""
    return SimpleNamespace(gen_samples=lambda n: points[..., :n, :])


def test_distributions_of_qmcpy_are_sequences():
    points = np.random.default_rng(1).random((16, 3))
    sequence = tabulate(replicated(points), 8)
    found = sequence.points(8, dtype=np.float64)
    assert sequence.size == 8 and np.array_equal(found, points[:8] * 2**32 // 1 / 2**32)


test_distributions_of_qmcpy_must_draw_points = refused(
    (np.zeros((2, 8, 3)), ValueError, r"generator must draw points of shape \(8, dims\), got .*\(2, 8, 3\)"),
    (np.full((8, 2), -0.5), ValueError, r"generator: points must be in \[0, 1\)"),
    (np.ones((8, 2), int), TypeError, "generator: points must be floats"),
    call=lambda points: tabulate(replicated(points), 8),
)


@pytest.mark.parametrize("engine", [qmc.Sobol(3, rng=1), qmc.LatinHypercube(3, rng=1)])
def test_a_sequence_has_the_points_of_an_engine(engine):
    points = engine.random(32)
    sequence = sequences.tabulated(points)
    expected = np.floor(points * 2**32)
    assert np.array_equal(sequence.bits(np.arange(32, dtype=np.uint32)), expected)
    assert np.array_equal(sequence.points(20, 12, dtype=np.float64), expected[12:] / 2**32)
    assert sequences.owen(sequence, key=1).points(32).shape == (32, 3)
    # The last number below one stays below.
    assert np.array_equal(sequences.tabulated([[1 - 2.0**-53, 0.0]])(0), [1 - 2.0**-24, 0])


def test_engines_of_scipy_go_on_where_they_are():
    engine = qmc.Halton(2, scramble=False)
    engine.fast_forward(5)
    assert np.allclose(tabulate(engine, 7).points(7), qmc.Halton(2, scramble=False).random(12)[5:])
    assert SequenceEngine(sequences.sobol(2)).random(0).shape == (0, 2)


def test_an_engine_draws_the_sequence_block_by_block():
    engine, points = SequenceEngine(SOBOL), np.asarray(SOBOL.points(40, dtype=np.float64))
    assert np.array_equal(np.concatenate([engine.random(n) for n in (5, 11, 0)]), points[:16])
    assert np.array_equal(engine.fast_forward(4).random(20), points[20:40])
    assert np.array_equal(engine.reset().random(3), points[:3])
    assert engine.d == 3 and analysis.SequenceEngine is SequenceEngine
    assert engine.integers(2, u_bounds=10, n=4).max() < 10


def after_three():
    """Return an engine that has one of its four points left."""
    engine = SequenceEngine(sequences.hammersley_net(2))
    engine.random(3)
    return engine


test_engines_end = refused(
    (lambda: SequenceEngine(sequences.hammersley_net(2)).random(5), r"n must be .* \[0, 4\], got 5"),
    (lambda: SequenceEngine(sequences.hammersley_net(2)).fast_forward(5), "n must be .* got 5"),
    (lambda: after_three().fast_forward(2), r"n must be .* \[0, 1\], got 2"),
    (lambda: after_three().fast_forward(1).random(1), r"n must be .* \[0, 0\], got 1"),
    error=ValueError,
)


@pytest.mark.parametrize("make", [sequences.sobol, *tables.slow(sequences.halton, sequences.lattice)])
def test_qmc_quad_takes_an_engine(make):
    """Its estimates are independent: errors of exp(x + y) are as its standard errors say, over seeds."""
    sequence, exact, ratios = make(2), np.expm1(1) * np.expm1(2), []
    for seed in range(12):
        engine = SequenceEngine(sequence, seed=seed)
        found = qmc_quad(lambda x: np.exp(x.sum(axis=0)), [0, 0], [1, 2], n_points=64, qrng=engine)
        assert 1e-6 < found.standard_error < 0.02 * exact
        ratios.append((found.integral - exact) / found.standard_error)
    # Of Student's t with 7 degrees of freedom, of variance 7 / 5 and fourth moment 9.8.
    assert abs(np.mean(np.square(ratios)) - 7 / 5) < 5 * np.sqrt((9.8 - 1.96) / 12)
    again = [SequenceEngine(sequence, seed=3).random(4) for _ in range(2)]
    np.testing.assert_array_equal(*again)


class Engines(test_qmc.QMCEngineTests):
    """Keys are drawn of the engine's random numbers, as scipy's engines draw their scrambling."""

    __test__ = False
    can_scramble = True

    @classmethod
    def qmce(cls, d, *, scramble, seed=None, optimization=None):
        generator = seed if isinstance(seed, np.random.Generator) else np.random.default_rng(seed)
        sequence = cls.sequence(d)
        if scramble:
            sequence = sequences.owen(sequence, key=int(generator.integers(2**32)))
        return SequenceEngine(sequence, optimization=optimization, rng=seed)

    @property
    def unscramble_nd(self):
        return self.scipys(2, scramble=False).random(8)

    @property
    def scramble_nd(self):
        return np.asarray(self.engine(d=2, scramble=True).sequence.points(8, dtype=np.float64))

    def test_0dim(self):
        """A sequence has at least one dimension, so that there is no engine without."""
        with pytest.raises(ValueError, match=r"dims must be an integer in \[1, "):
            self.engine(d=0, scramble=False)


@pytest.mark.slow
class TestSobol(Engines):
    """Of Sobol' points in Gray order, as in scipy."""

    __test__ = True
    scipys = qmc.Sobol

    @staticmethod
    def sequence(d):
        return sequences.gray(sequences.sobol(d))


@pytest.mark.slow
class TestHalton(Engines):
    __test__ = True
    scipys = qmc.Halton
    sequence = staticmethod(sequences.halton)
