"""The model of cost: it finds what made the numbers, and tells how far it is off."""

import numpy as np
import pytest

from figures.commands.cost_model import MEMORY, TIME, Sizes, fitted

TRUE = {
    "calls": 1e-3,
    "pixels": 2e-8,
    "pixels, further coordinates": 1e-8,
    "samples": 3e-9,
    "samples, further coordinates": 1e-9,
    "samples, further pairs": 2e-9,
    "samples, digits of their numbers": 2e-10,
    "scene": 5e-9,
    "sharing": 4e-10,
}
GRID = [
    *(Sizes(p, s, 2) for p in (4096, 16384, 65536) for s in (16, 64)),
    *(Sizes(16384, s, 2) for s in (256, 1024)),
    *(Sizes(16384, s, d, 1, False) for d in (2, 3, 4, 8) for s in (16, 64)),
    *(Sizes(p, 64, 2, 2) for p in (16384, 65536)),
]
FAR = Sizes(2**24, 4096, 2, 8)


def true(sizes):
    return sum(TRUE[name] * term(sizes) for name, term in TIME.items())


def test_exact_numbers_are_fitted_exactly():
    model = fitted(TIME, [(sizes, true(sizes)) for sizes in GRID])
    assert dict(zip(TIME, model.coefficients, strict=True)) == pytest.approx(TRUE, rel=1e-6)
    found = model.predict(FAR)
    assert found.value == pytest.approx(true(FAR)) and sum(found.shares.values()) == pytest.approx(1)
    assert found.low == pytest.approx(found.high)


def test_spread_holds_what_is_true():
    """With noise of 5 %, the truth 2**20 times as far out is nearly always within the spread."""
    within, errors = 0, []
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(1, 0.05, len(GRID))
        found = fitted(TIME, [(s, true(s) * n) for s, n in zip(GRID, noise, strict=True)]).predict(FAR)
        within += found.low <= true(FAR) <= found.high
        errors.append(found.value / true(FAR) - 1)
    assert within >= 90
    assert np.mean(np.abs(errors)) < 0.1


def test_nothing_is_negative():
    """Noise alone would make it so."""
    rng = np.random.default_rng(1)
    model = fitted(MEMORY, [(Sizes(p, 16, 2), 1e8 * rng.normal(1, 0.01)) for p in (4096, 65536, 2**20)])
    assert (model.coefficients >= 0).all() and (model.others >= 0).all()
