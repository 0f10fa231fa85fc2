"""Eight numbers at a time in compiled loops against NumPy."""

import numpy as np
import pytest

numba = pytest.importorskip("numba", reason="numba is not installed")


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_lanes_are_numbers_side_by_side(dtype):
    """Operators with lanes and scalars, conditions, and what is chosen where one of two is NaN."""
    from qmcjax.tracing.search import lanes

    @numba.njit(error_model="numpy")
    def computed(given, factor, out):
        a, b = lanes.load(given, 0), lanes.load(given, 1)
        lanes.store(out, 0, (a + b) * factor - a / b)
        lanes.store(out, 1, lanes.larger(a, b))
        lanes.store(out, 2, lanes.smaller(a, b))
        lanes.store(out, 3, lanes.larger(factor, a))
        here = ((a > b) | (b >= 1)) & (a != 0)
        return lanes.bits(here), lanes.bits((a < b) & (a <= factor)), lanes.larger(factor, 2 * factor)

    rng = np.random.default_rng(0)
    for _ in range(20):
        given, out = rng.normal(size=(2, lanes.WIDTH)).astype(dtype), np.empty((4, lanes.WIDTH), dtype)
        given[rng.integers(2), rng.integers(8)] = np.nan
        given[0, rng.integers(8)] = 0
        (a, b), factor = given, np.dtype(dtype).type(0.5)
        first, second, both = computed(given, factor, out)
        wanted = [
            (a + b) * factor - a / b,
            np.where(b > a, b, a),
            np.where(b < a, b, a),
            np.where(a > factor, a, factor),
        ]
        np.testing.assert_array_equal(out, np.stack(wanted))
        places = 2 ** np.arange(8)
        assert first == places[((a > b) | (b >= 1)) & (a != 0)].sum()
        assert second == places[(a < b) & (a <= factor)].sum()
        assert both == 1


def test_bits_are_visited_from_the_lowest_one_on():
    from qmcjax.tracing.search.lanes import lowest

    @numba.njit
    def place(number):
        return lowest(number)

    assert [place(number) for number in (1, 2, 12, 128)] == [0, 1, 2, 7]
