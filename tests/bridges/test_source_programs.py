"""Programs of scalars that jaxprs are read into: small, and with the results of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import evaluated

from qmcjax.bridges._source import Repeat, read
from qmcjax.bridges._source._lower import lowered

U = jax.ShapeDtypeStruct((), np.uint32)


def kinds(function, *examples):
    return [value.kind for value in read(function, *examples).computed()]


def test_constants_are_folded_and_common_values_made_once():
    def repeated(x):
        table = jnp.arange(5, dtype=jnp.uint32) * np.uint32(3)
        unused = x * np.uint32(77)
        del unused
        return (x ^ table[4]) + (x ^ np.uint32(12))

    assert kinds(repeated, U) == ["xor", "add"]
    assert kinds(lambda x: (x & np.uint32(7)) < np.uint32(8), U) == []
    assert kinds(lambda x: (x >> 40) + x % np.uint32(16), U) == ["and"]


def test_loops_are_unrolled_if_they_are_small():
    def power(count):
        return lambda x: jax.lax.fori_loop(0, count, lambda _, y: y * np.uint32(3) + x, x)

    assert not any(isinstance(s, Repeat) for s in read(power(4), U).statements)
    long = read(power(1000), U)
    assert sum(isinstance(s, Repeat) for s in long.statements) == 1
    x = np.arange(50, dtype=np.uint32)
    assert np.array_equal(evaluated(long, x)[0], jax.vmap(power(1000))(x))


def test_invariants_of_loops_are_hoisted():
    def sum_of(x, y):
        return jax.lax.fori_loop(0, 1000, lambda i, z: (z ^ (x * y)) + np.uint32(1), x)

    program = read(sum_of, U, U)
    assert [v.kind for s in program.statements for v in ([s.value] if hasattr(s, "value") else [])] == ["mul"]


def test_loops_in_loops():
    def steps(x, y):
        def inner(z):
            return jax.lax.while_loop(lambda w: w > y, lambda w: (w >> 1) ^ (x & np.uint32(1)), z)

        return jax.lax.fori_loop(0, 600, lambda i, z: inner(z + x * np.uint32(2654435769)), y)

    rng = np.random.default_rng(7)
    x, y = (rng.integers(1, 2**20, 100).astype(np.uint32) for _ in range(2))
    program = read(steps, U, U)
    assert np.array_equal(evaluated(program, x, y)[0], jax.vmap(steps)(x, y))


ROW = np.arange(60, dtype=np.uint32) * np.uint32(77)
INTEGERS = {
    "quotients": lambda x, y: (x // y, x % y, x.astype(jnp.int32) // y.astype(jnp.int32)),
    "shifts": lambda x, y: (x << y, x >> y, x.astype(jnp.int32) >> (y & np.uint32(63)).astype(jnp.int32)),
    "counts": lambda x, y: (jax.lax.clz(x), jax.lax.population_count(y)),
    "narrow": lambda x, y: x.astype(jnp.uint16) * y.astype(jnp.uint8).astype(jnp.uint16),
    "signed": lambda x, y: jnp.abs(x.astype(jnp.int32)) + jnp.sign(y.astype(jnp.int32)),
    "scatter": lambda x, y: jnp.zeros(6, jnp.uint32).at[y].set(x, mode="drop"),
    "update": lambda x, y: jax.lax.dynamic_update_slice(jnp.asarray(ROW[:6]), jnp.stack([x, y]), (y,)),
    "gather": lambda x, y: jnp.asarray(ROW).reshape(6, 10)[x % np.uint32(7), y % np.uint32(11)],
    "filled": lambda x, y: jnp.asarray(ROW).at[x % np.uint32(70)].get(mode="fill", fill_value=5) ^ y,
    "keys": lambda x, y: jax.random.bits(jax.random.fold_in(jax.random.key(3), x), (3,), jnp.uint32) + y,
    "split": lambda x, y: jax.random.key_data(jax.random.split(jax.random.key(x), 3)) ^ y,
    "branches": lambda x, y: jax.lax.switch(
        x & np.uint32(3), [lambda z: z, lambda z: ~z, lambda z: z * z], y
    ),
    "sums": lambda x, y: jnp.cumsum(jnp.stack([x, y, x ^ y])) + jnp.sum(jnp.stack([x, y])),
}


def of_all_sizes(count):
    rng = np.random.default_rng(7)
    return [
        rng.integers(0, 2**32, count, dtype=np.uint32) >> rng.integers(0, 32, count).astype(np.uint32)
        for _ in range(2)
    ]


@pytest.mark.parametrize("name", list(INTEGERS))
def test_operations_are_those_of_jax(name):
    function, (x, y) = INTEGERS[name], of_all_sizes(500)
    found = evaluated(read(function, U, U), x, y)
    wanted = jax.tree.leaves(jax.vmap(function)(x, y))
    columns = [column for array in wanted for column in np.asarray(array).reshape(500, -1).T]
    for one, other in zip(found, columns, strict=True):
        assert np.array_equal(one, other)


def in_64(function):
    def made(x, y):
        with jax.enable_x64(True):
            results = function(
                x.astype(jnp.float64) * 0.37, y.astype(jnp.float64) + 0.1, x.astype(jnp.uint64)
            )
            return [
                jax.lax.bitcast_convert_type(r, jnp.uint64).astype(jnp.uint32) if r.dtype.itemsize == 8 else r
                for r in results
            ]

    return made


WIDE = {
    "sum": lambda a, b, n: (a + b, a - b, b - a),
    "product": lambda a, b, n: (a * b, a * 2.0**-40, -a * b),
    "quotient": lambda a, b, n: (a / b, (a / b).astype(jnp.float32)),
    "root": lambda a, b, n: (jnp.sqrt(a), jnp.sqrt(b / 3)),
    "rounded": lambda a, b, n: (jnp.floor(a / b - 2), jnp.ceil(a / b - 2), a.astype(jnp.uint32)),
    "compared": lambda a, b, n: (a < b, jnp.minimum(a, b - 1e9), jnp.maximum(-a, -b)),
    "integers": lambda a, b, n: (n * n * n, (n * n) // (n + 3), (n * n) % (n + 3), n * n >> (n & 63)),
    "converted": lambda a, b, n: ((a * b).astype(jnp.uint64), (n * n).astype(jnp.float64)),
}


@pytest.mark.parametrize("name", list(WIDE))
def test_words_are_what_64_bits_are(name):
    x, y = of_all_sizes(20000)
    program = read(in_64(WIDE[name]), U, U)
    words = lowered(program)
    assert all(value.dtype.itemsize == 4 or value.dtype == bool for value in words.computed())
    for wide, narrow in zip(evaluated(program, x, y), evaluated(words, x, y), strict=True):
        assert np.array_equal(wide, narrow)
