"""Scipy's own tests of engines, on ours of Sobol' points in Gray order, as in scipy, and Halton points."""

import numpy as np
import pytest
from scipy.stats import qmc
from scipy.stats.tests import test_qmc

from qmcjax import sequences
from qmcjax.bridges import SequenceEngine

pytestmark = pytest.mark.slow


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


class TestSobol(Engines):
    __test__ = True
    scipys = qmc.Sobol

    @staticmethod
    def sequence(d):
        return sequences.gray(sequences.sobol(d))


class TestHalton(Engines):
    __test__ = True
    scipys = qmc.Halton
    sequence = staticmethod(sequences.halton)
