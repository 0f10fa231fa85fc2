"""Orders: bijections of the padded raster, their locality, and independent definitions."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import ORDERS, again, each, first

from qmcjax import orders

ART = {"scrambled_morton, art": partial(orders.scrambled_morton, key=7, variant="art")}
each_order = each("make", ORDERS | ART)


def pixels(order):
    """Pixels along the curve, one row each."""
    columns, rows = order.pixel(again(first(order.length), max(order.length, 81**2)))
    return np.stack([columns, rows], axis=1)[: order.length].astype(np.int64)


@each_order
@pytest.mark.parametrize("size", [(1, 1), (2, 2), (5, 3), (3, 5), (64, 64), (512, 512)])
def test_bijection(make, size):
    """Every pixel of the padded raster has one position; ``pixel`` and ``position`` invert each other."""
    order = make(*size)
    curve = pixels(order)
    columns, rows = order.raster
    assert columns >= size[0] and rows >= size[1]
    assert order.length == columns * rows == len(np.unique(curve[:, 0] + columns * curve[:, 1]))
    x, y = (again(c.astype(np.uint32), max(order.length, 81**2)) for c in curve.T)
    assert np.array_equal(order.position(x, y)[: order.length], first(order.length))


@each_order
def test_bijection_at_the_largest_size(make):
    side = orders.PEANO_SIDE if make is orders.peano else orders.MAX_SIDE
    order = make(side, side)
    assert order.length == side**2
    rng = np.random.default_rng(0)
    position = jnp.asarray(rng.integers(0, side**2, 10**5, dtype=np.uint32))
    assert np.array_equal(order.position(*order.pixel(position)), position)
    x, y = (jnp.asarray(rng.integers(0, side, 10**5, dtype=np.uint32)) for _ in range(2))
    assert np.array_equal(np.stack(order.pixel(order.position(x, y))), np.stack([x, y]))


def test_hilbert_equals_its_grammar():
    """Four copies of the smaller curve: transposed, twice as it is, transposed about the other diagonal."""
    curve = np.array([[0, 0]])
    for k in range(6):
        side, (x, y) = 2**k, curve.T
        parts = [(y, x), (x, y + side), (x + side, y + side), (2 * side - 1 - y, side - 1 - x)]
        curve = np.concatenate([np.stack(part, axis=1) for part in parts])
        assert np.array_equal(pixels(orders.hilbert(2 * side, 2 * side)), curve)


def test_morton_interleaves_digits():
    x, y = first(64), first(64)[::-1]
    expected = [
        int("".join(b + a for a, b in zip(f"{u:06b}", f"{v:06b}", strict=True)), 2)
        for u, v in zip(x, y, strict=True)
    ]
    assert orders.morton(64, 64).position(jnp.asarray(x), jnp.asarray(y.copy())).tolist() == expected


@each_order
def test_any_shape_broadcasts_and_jit_and_vmap_agree(make):
    order = make(20, 12)
    row, column = jnp.arange(12, dtype=jnp.uint32), jnp.arange(20, dtype=jnp.uint32)
    table = order.position(column[None, :], row[:, None])
    assert table.shape == (12, 20)

    @jax.jit
    def ways(order):
        row_by_row = jax.vmap(lambda y: order.position(column, y))
        return order.position(column[None, :], row[:, None]), row_by_row(row)

    for compiled in ways(order):
        assert np.array_equal(compiled, table)
    assert order.position(3, 2) == table[2, 3]


@each_order
def test_bad_pixels_and_positions_are_named(make):
    order = make(3, 3)  # padded to 3 or 4 pixels a side
    with pytest.raises(ValueError, match=r"x must be integers in \[0, [23]\], got 4"):
        order.position(4, 0)
    with pytest.raises(ValueError, match=r"y must be integers in \[0, [23]\], got 9"):
        order.position(0, np.array([1, 9], np.uint32))
    with pytest.raises(ValueError, match=r"position must be integers in \[0, (8|15)\], got 16"):
        order.pixel(16)
    assert order.pixel(np.arange(3))[0].dtype == np.uint32


class Columns:
    """Column by column: an order of a user, without decorator, base class or inverse."""

    width, height, length = 5, 3, 15

    def position(self, x, y):
        return x * np.uint32(3) + y


def test_any_object_with_the_protocol_is_an_order():
    order = orders.as_order("order", Columns())
    x, y = jnp.meshgrid(jnp.arange(5, dtype=jnp.uint32), jnp.arange(3, dtype=jnp.uint32))
    assert np.array_equal(jax.jit(lambda o: o.position(x, y))(order), np.arange(15).reshape(5, 3).T)
    assert (order.raster, order.length) == ((5, 3), 15)
    assert orders.as_order("order", order) is order
    with pytest.raises(TypeError, match=r"order must have a method pixel\(position\), got .*Columns"):
        order.pixel(0)


@pytest.mark.parametrize(
    ("position", "message"),
    [
        (
            lambda x, y: x.astype(np.float32),
            r"order must have position return integers of shape \(3,\), got float32 \(3,\)",
        ),
        (lambda x, y: x[:1], r"order must have position return integers of shape \(3,\), got uint32 \(1,\)"),
        (lambda x, y: 3, "order must have position return integers .* got 3"),
        (lambda x, y: x + np.uint32(13), r"order must have positions in \[0, length=15\), got 15"),
    ],
)
def test_positions_of_a_user_are_checked(position, message):
    value = Columns()
    value.position = position
    with pytest.raises(ValueError, match=message):
        orders.as_order("order", value).position(first(3), 0)


def test_a_permutation_is_looked_up_and_inverted():
    image = np.random.default_rng(3).permutation(35).reshape(5, 7)
    order = orders.permutation(image)
    y, x = np.mgrid[:5, :7]
    assert (order.width, order.height, order.length) == (7, 5, 35)
    assert np.array_equal(order.position(x, y), image)
    assert np.array_equal(np.stack(order.pixel(image)), [x, y])
    # What a curve does with a table of its positions, it does without.
    hilbert = orders.hilbert(8, 8)
    y, x = np.mgrid[:8, :8]
    assert np.array_equal(orders.permutation(hilbert.position(x, y)).pixel(9), hilbert.pixel(9))
