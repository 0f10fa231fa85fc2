"""Jaxprs of other versions of JAX: primitives and parameters that are new, or gone."""

from functools import partial
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import evaluated
from refusals import refused

from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._read import finished, inputs_of, reader_of

X, Y = np.random.default_rng(7).integers(0, 2**20, (2, 200)).astype(np.uint32)


def changed(jaxpr, change, close):
    """Return a jaxpr whose equations have other names and parameters, with its constants or without."""
    inner = getattr(jaxpr, "jaxpr", jaxpr)

    def parameter(value):
        if isinstance(value, tuple):
            return tuple(map(parameter, value))
        return changed(value, change, close) if hasattr(getattr(value, "jaxpr", value), "eqns") else value

    equations = []
    for equation in inner.eqns:
        params = {name: parameter(value) for name, value in equation.params.items()}
        name = change(equation.primitive.name, params)
        primitive = SimpleNamespace(name=name, multiple_results=equation.primitive.multiple_results)
        primitive.bind = partial(_bound, equation)
        known = SimpleNamespace(
            invars=equation.invars, outvars=equation.outvars, source_info=equation.source_info
        )
        equations.append(SimpleNamespace(primitive=primitive, params=params, **vars(known)))
    made = SimpleNamespace(
        eqns=equations, constvars=inner.constvars, invars=inner.invars, outvars=inner.outvars
    )
    consts = getattr(jaxpr, "consts", ())
    return SimpleNamespace(jaxpr=made, consts=consts) if close or consts else made


def _bound(equation, *given, **params):
    """Compute an equation of constants as it was."""
    return equation.primitive.bind(*given, **equation.params)


def read(function, change=lambda name, params: name, close=True):
    """Read a function of two words whose equations are changed."""
    closed = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct((), np.uint32),) * 2)
    builder = Builder()
    inputs = inputs_of(builder, [var.aval for var in closed.jaxpr.invars])
    outputs = reader_of(builder).read(changed(closed, change, close), inputs)
    return finished(builder, [entries[()] for entries in inputs], outputs)


def without(*gone):
    """Return a change that takes parameters away, and adds some that say how to compute."""

    def change(name, params):
        for parameter in gone:
            params.pop(parameter, None)
        params.update(out_sharding=None, something_new=None, unroll=3)
        return name

    return change


def loops(x, y):
    """Loops of all kinds, with constants, rows, results and a condition that use what is outside."""
    table = jnp.arange(6, dtype=jnp.uint32) * np.uint32(77)
    total, rows = jax.lax.scan(lambda a, row: (a * y + row, a ^ row), x, table + x, reverse=True)
    long = jax.lax.fori_loop(0, 900, lambda i, a: (a[0] * y + table[2], a[1]), (x, y))[0]
    bits = jax.lax.while_loop(lambda a: a > y, lambda a: (a >> 1) ^ (x & np.uint32(1)), x)
    chosen = jax.lax.cond(x > y, lambda a: a + y, lambda a: jax.checkpoint(lambda b: b * y)(a), x)
    return jnp.stack([total, long, bits, chosen, *rows])


@pytest.mark.parametrize("close", [True, False])
def test_loops_need_no_counts_of_their_arguments(close):
    gone = without("num_consts", "num_carry", "ft_in", "ft_out", "cond_nconsts", "body_nconsts", "linear")
    found = evaluated(read(loops, gone, close), X, Y)
    assert np.array_equal(np.transpose(found), jax.vmap(loops)(X, Y))


def test_new_primitives_mean_what_they_say():
    """Made of old equations with the same arguments: a sum becomes a polynomial."""
    polynomial = read(lambda x, y: jax.lax.clamp(x, y, np.uint32(7)), lambda *_: "polynomial")
    assert np.array_equal(evaluated(polynomial, X, Y)[0], Y + 7 * X)
    one = read(lambda x, y: -x, lambda *_: "one_minus_square")
    assert np.array_equal(evaluated(one, X, Y)[0], (1 + X) * (1 - X))
    builder = Builder()
    (rows,) = inputs_of(builder, [jax.ShapeDtypeStruct((2, 3), np.uint32)])
    for axis, entries in ((0, rows), (1, rows), (0, rows[0])):
        equation = SimpleNamespace(params={"axis": axis})
        made = reader_of(builder).rules["unstack"](None, equation, [entries])
        assert len(made) == entries.shape[axis] and all(part.ndim == entries.ndim - 1 for part in made)
        assert np.array_equal(np.stack(made, axis), entries)


def renamed(name, params):
    return "of_tomorrow" if name == "cumsum" else name


def with_more(name, params):
    if name == "cumsum":
        params["exclusive"] = True
    return name


def sums(x, y):
    return jnp.cumsum(jnp.full(3, x))


test_others_are_refused_with_their_line = refused(
    (renamed, "got 'of_tomorrow' at .*test_source_jaxprs.py"),
    (with_more, r"got 'cumsum' \(with the parameters \['exclusive'\] .*test_source_jaxprs.py"),
    (without("axis"), r"got 'cumsum' \(it has no parameter 'axis' .*test_source_jaxprs.py"),
    call=lambda change: read(sums, change),
    error=ValueError,
)
test_loops_without_their_jaxprs_are_refused = refused(
    *(
        (without(name), f"it has no parameter '{name}' .*loops")
        for name in ("length", "cond_jaxpr", "branches")
    ),
    call=lambda change: read(loops, change),
    error=ValueError,
)
