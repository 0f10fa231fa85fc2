"""Orders of pixels and frames: bijections, blocks, neighbours, uniform permutations."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from tables import first

from qmcjax import orders

ORDERS = {
    "morton3": orders.morton3,
    "morton3, scrambled": partial(orders.morton3, key=7),
    "hilbert3": orders.hilbert3,
}
SIZES = [(1, 1, 1), (8, 5, 2), (3, 2, 9), (4, 4, 4), (1, 1, 8), (6, 7, 1), (16, 3, 4)]


def pixels(order):
    """Return x, y and t of all positions."""
    return np.stack([np.asarray(v) for v in order.pixel(first(order.length))]).astype(np.int64)


@pytest.mark.parametrize("make", ORDERS.values(), ids=ORDERS)
@pytest.mark.parametrize("size", SIZES)
def test_orders_of_pixels_and_frames_are_bijections(make, size):
    order = make(*size)
    side, frames = 2**order.log_side, 2**order.log_frames
    assert side >= max(size[:2]) > side // 2 and frames >= size[2] > frames // 2
    x, y, t = pixels(order)
    assert order.length == side**2 * frames
    assert len(set(zip(x.tolist(), y.tolist(), t.tolist(), strict=True))) == order.length
    assert max(x.max(), y.max()) == side - 1 and t.max() == frames - 1
    np.testing.assert_array_equal(order.position(x, y, t), first(order.length))


@pytest.mark.parametrize("size", SIZES)
def test_consecutive_positions_of_the_hilbert_order_are_neighbours(size):
    assert (np.abs(np.diff(pixels(orders.hilbert3(*size)))).sum(axis=0) == 1).all()


def test_the_morton_order_has_no_such_neighbours_and_hilbert_of_one_frame_is_a_curve_in_the_plane():
    assert np.abs(np.diff(pixels(orders.morton3(4, 4, 4)))).sum(axis=0).max() > 1
    x, y, t = pixels(orders.hilbert3(16, 16, 1))
    assert not t.any()
    plane = np.stack([np.asarray(v) for v in orders.hilbert(16, 16).pixel(first(256))])
    np.testing.assert_array_equal(np.stack([x, y]), plane)


@pytest.mark.parametrize("make", ORDERS.values(), ids=ORDERS)
@pytest.mark.parametrize("size", [(8, 8, 8), (8, 8, 2), (2, 2, 16)])
def test_cubes_have_contiguous_aligned_runs(make, size):
    order = make(*size)
    x, y, t = pixels(order)
    levels = min(order.log_side, order.log_frames)
    for k in range(levels + 1):
        runs = (x >> k << 40 | y >> k << 20 | t >> k).reshape(-1, 8**k)
        assert (runs == runs[:, :1]).all()
        if "Morton3" in type(order).__name__ and k < order.log_frames:
            # Halves of the frames are the last digits: the same pixels in twice as many frames.
            runs = (x >> k << 40 | y >> k << 20 | t >> (k + 1)).reshape(-1, 2 * 8**k)
            assert (runs == runs[:, :1]).all()


def test_windows_that_are_no_blocks_have_no_contiguous_run():
    """The guarantee ends there: one pixel in four frames is spread over the order."""
    positions = np.asarray(orders.morton3(4, 4, 4).position(0, 0, first(4)))
    assert positions.max() - positions.min() >= 4


@pytest.mark.slow
def test_permutations_of_blocks_are_uniform_over_keys():
    """Quadrants of the first node, and halves below the first quadrant: frequencies within 5 sigma."""
    keys = 2400

    def order(seed):
        made = orders.morton3(4, 4, 4, jax.random.wrap_key_data(jnp.stack([seed, seed ^ 5])))
        x, t = jnp.array([0, 2, 0, 2, 0], jnp.uint32), jnp.array([0, 0, 0, 0, 2], jnp.uint32)
        y = jnp.array([0, 0, 2, 2, 0], jnp.uint32)
        return made.unchecked_position(x, y, t)

    positions = np.asarray(jax.vmap(order)(first(keys)))
    quadrants = positions[:, :4] >> 4
    numbers = np.unique(quadrants @ [64, 16, 4, 1], return_inverse=True)[1]
    counts = np.bincount(numbers)
    assert len(counts) == 24
    assert np.abs(counts - keys / 24).max() < 5 * np.sqrt(keys / 24 * 23 / 24)
    # The half of the first frame in its quadrant: a coin that depends on nothing above.
    half = (positions[:, 0] >> 3) & 1
    assert (half != (positions[:, 4] >> 3) & 1).all()
    assert abs(half.mean() - 0.5) < 5 * 0.5 / np.sqrt(keys)
    agreement = (half == (quadrants[:, 0] & 1)).mean()
    assert abs(agreement - 0.5) < 5 * 0.5 / np.sqrt(keys)


@pytest.mark.parametrize("make", ORDERS.values(), ids=ORDERS)
def test_one_frame_is_an_order_of_pixels_that_is_traced_once(make):
    order = make(5, 7, 6)
    x, y = first(5)[None, :], first(7)[:, None]
    traces = []

    @jax.jit
    def positions(frame):
        traces.append(frame)
        return order.at_frame(frame).position(x, y)

    for frame in (0, 5, 7):
        expected = np.asarray(order.position(x, y, np.uint32(frame)))
        np.testing.assert_array_equal(positions(frame), expected)
        one = order.at_frame(frame)
        np.testing.assert_array_equal(one.position(x, y), expected)
        np.testing.assert_array_equal(one.at_frame(1).position(x, y), order.position(x, y, np.uint32(1)))
        assert [int(v) for v in one.pixel(int(expected[3, 2]))] == [2, 3]
    assert len(traces) == 1


def test_large_orders_have_positions_of_32_bits():
    for make in ORDERS.values():
        order = make(1920, 1080, 1024)
        assert order.length == 2**32
        x, y, t = (np.array(v, np.uint32) for v in ([0, 1919, 2047], [5, 1079, 2047], [3, 1000, 1023]))
        again = order.pixel(order.position(x, y, t))
        np.testing.assert_array_equal(np.stack(again), np.stack([x, y, t]))


test_wrong_sizes_and_frames_are_refused = refused(
    (lambda: orders.morton3(1920, 1080, 1025), r"frames must be .* in \[1, 1024\], got 1025"),
    (lambda: orders.hilbert3(1, 1, 0), r"frames must be .* in \[1, 4294967296\], got 0"),
    (
        lambda: orders.as_order("order", orders.morton3(4, 4, 2)),
        TypeError,
        r"order must be an order of pixels, as .at_frame\(t\) returns, got Morton3",
    ),
    (lambda: orders.hilbert3(4, 4, 5).at_frame(8), r"frame must be .* in \[0, 7\], got 8"),
    (lambda: orders.hilbert3(4, 4, 5).position(0, 0, 8), r"t must be .* in \[0, 7\], got 8"),
    (lambda: orders.morton3(4, 4, 5).at_frame(np.arange(2)), r"one integer, got shape \(2,\)"),
    error=ValueError,
)
