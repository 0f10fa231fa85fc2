"""Programs of scalars that jaxprs are read into, of this and other versions of JAX: small, and exact."""

from functools import partial
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused

from qmcjax.bridges._source import Compute, Repeat, read
from qmcjax.bridges._source._builder import Builder
from qmcjax.bridges._source._lower import lower
from qmcjax.bridges._source._operations import OPERATIONS
from qmcjax.bridges._source._read import inputs_of, program_of, reader_of


def evaluated(program, *inputs):
    """Return the outputs of a program for arrays of inputs, all of one shape."""
    shape = np.shape(inputs[0])
    values = {}

    def value(wanted):
        if wanted.kind == "constant":
            return np.broadcast_to(wanted.detail, shape)
        return inputs[wanted.detail] if wanted.kind == "input" else values[wanted]

    def run(statements):
        for statement in statements:
            if isinstance(statement, Compute):
                made = statement.value
                values[made] = computed(made, [value(argument) for argument in made.arguments])
            else:
                repeat(statement)

    def repeat(statement):
        loop, kept = statement.loop, statement.kept
        state = [np.array(value(loop.initial[n])) for n in kept]
        while True:
            values.update({loop.variables[n]: array for n, array in zip(kept, state, strict=True)})
            run(statement.head)
            going = value(loop.condition)
            if not going.any():
                break
            run(statement.body)
            following = [value(loop.following[n]) for n in kept]
            state = [np.where(going, new, old) for new, old in zip(following, state, strict=True)]
        results.update({(loop, n): array for n, array in zip(kept, state, strict=True)})

    results = {}

    class Results(dict):
        def __missing__(self, wanted):
            return results[wanted.loop, wanted.detail]

    values = Results()
    with np.errstate(all="ignore"):
        run(program.statements)
    return [value(output) for output in program.outputs]


def computed(made, given):
    if made.kind == "load":
        return made.detail.entries[given[0]].astype(made.dtype)
    if made.kind == "select":
        return np.where(*given)
    if made.kind in ("convert", "bitcast"):
        return given[0].astype(made.dtype) if made.kind == "convert" else given[0].view(made.dtype)
    fold = OPERATIONS[made.kind].fold
    if made.kind == "reverse":
        return np.array([fold(word) for word in given[0]])
    function = fold or getattr(np, NUMPY.get(made.kind, made.kind))
    return function(*given).astype(made.dtype)


NUMPY = {"atan": "arctan", "asin": "arcsin", "acos": "arccos", "atan2": "arctan2", "pow": "power"}


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
BRANCHES = [lambda z: z, lambda z: ~z, lambda z: z * z]
INTEGERS = {
    "quotients": lambda x, y: (x // y, x % y, x.astype(jnp.int32) // y.astype(jnp.int32)),
    "shifts": lambda x, y: (x << y, x >> y, x.astype(jnp.int32) >> (y & np.uint32(63)).astype(jnp.int32)),
    "shifts with and without a sign": lambda x, y: (
        jax.lax.shift_right_logical(x.astype(jnp.int32), y.astype(jnp.int32)),
        jax.lax.shift_right_arithmetic(x, y % np.uint32(40)),
        jax.lax.shift_right_arithmetic(np.uint32(0x87654321), y % np.uint32(40)),
    ),
    "bools": lambda x, y: (
        jnp.minimum(x > y, y > np.uint32(9)),
        jax.lax.max(x > y, y > np.uint32(9)),
        *(compare(x > y, y > np.uint32(9)) for compare in (jax.lax.lt, jax.lax.le, jax.lax.gt, jax.lax.ge)),
    ),
    "counts": lambda x, y: (jax.lax.clz(x), jax.lax.population_count(y)),
    "narrow": lambda x, y: x.astype(jnp.uint16) * y.astype(jnp.uint8).astype(jnp.uint16),
    "signed": lambda x, y: jnp.abs(x.astype(jnp.int32)) + jnp.sign(y.astype(jnp.int32)),
    "scatter": lambda x, y: jnp.zeros(6, jnp.uint32).at[y].set(x, mode="drop"),
    "update": lambda x, y: jax.lax.dynamic_update_slice(jnp.asarray(ROW[:6]), jnp.stack([x, y]), (y,)),
    "gather": lambda x, y: jnp.asarray(ROW).reshape(6, 10)[x % np.uint32(7), y % np.uint32(11)],
    "filled": lambda x, y: jnp.asarray(ROW).at[x % np.uint32(70)].get(mode="fill", fill_value=5) ^ y,
    "keys": lambda x, y: jax.random.bits(jax.random.fold_in(jax.random.key(3), x), (3,), jnp.uint32) + y,
    "split": lambda x, y: jax.random.key_data(jax.random.split(jax.random.key(x), 3)) ^ y,
    "branches": lambda x, y: jax.lax.switch(x & np.uint32(3), BRANCHES, y),
    "sums": lambda x, y: jnp.cumsum(jnp.stack([x, y, x ^ y])) + jnp.sum(jnp.stack([x, y])),
}


def of_all_sizes(count):
    rng = np.random.default_rng(7)
    return rng.integers(0, 2**32, (2, count), np.uint32) >> rng.integers(0, 32, (2, count), np.uint32)


@pytest.mark.parametrize("name", list(INTEGERS))
def test_operations_are_those_of_jax(name):
    function, (x, y) = INTEGERS[name], of_all_sizes(500)
    found = evaluated(read(function, U, U), x, y)
    wanted = jax.tree.leaves(jax.vmap(function)(x, y))
    columns = [column for array in wanted for column in np.asarray(array).reshape(500, -1).T]
    for one, other in zip(found, columns, strict=True):
        assert np.array_equal(one, other)


def narrow(result):
    wide = result.dtype.itemsize == 8
    return jax.lax.bitcast_convert_type(result, jnp.uint64).astype(jnp.uint32) if wide else result


def in_64(function):
    def made(x, y):
        with jax.enable_x64(True):
            a, b = x.astype(jnp.float64) * 0.37, y.astype(jnp.float64) + 0.1
            return [narrow(result) for result in function(a, b, x.astype(jnp.uint64))]

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
    words = lower(program)
    assert all(value.dtype.itemsize == 4 or value.dtype == bool for value in words.computed())
    for wide, narrow in zip(evaluated(program, x, y), evaluated(words, x, y), strict=True):
        assert np.array_equal(wide, narrow)


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
        known = {each: getattr(equation, each) for each in ("invars", "outvars", "source_info", "ctx")}
        equations.append(SimpleNamespace(primitive=primitive, params=params, **known))
    known = {each: getattr(inner, each) for each in ("constvars", "invars", "outvars")}
    made = SimpleNamespace(eqns=equations, **known)
    consts = getattr(jaxpr, "consts", ())
    return SimpleNamespace(jaxpr=made, consts=consts) if close or consts else made


def _bound(equation, *given, **params):
    """Compute an equation of constants as it was."""
    return equation.primitive.bind(*given, **equation.params)


def read_changed(function, change=lambda name, params: name, close=True):
    """Read a function of two words whose equations are changed."""
    closed = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct((), np.uint32),) * 2)
    builder = Builder()
    inputs = inputs_of(builder, [var.aval for var in closed.jaxpr.invars])
    outputs = reader_of(builder).read(changed(closed, change, close), inputs)
    return program_of(builder, [entries[()] for entries in inputs], outputs)


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
    found = evaluated(read_changed(loops, gone, close), X, Y)
    assert np.array_equal(np.transpose(found), jax.vmap(loops)(X, Y))


def test_new_primitives_mean_what_they_say():
    """Made of old equations with the same arguments: a sum becomes a polynomial."""
    polynomial = read_changed(lambda x, y: jax.lax.clamp(x, y, np.uint32(7)), lambda *_: "polynomial")
    assert np.array_equal(evaluated(polynomial, X, Y)[0], Y + 7 * X)
    one = read_changed(lambda x, y: -x, lambda *_: "one_minus_square")
    assert np.array_equal(evaluated(one, X, Y)[0], (1 + X) * (1 - X))
    builder = Builder()
    (rows,) = inputs_of(builder, [jax.ShapeDtypeStruct((2, 3), np.uint32)])
    for axis, entries in ((0, rows), (1, rows), (0, rows[0])):
        parts = [jax.ShapeDtypeStruct(np.delete(entries.shape, axis), np.uint32)] * entries.shape[axis]
        equation = SimpleNamespace(params={"axis": axis}, made=parts)
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
    (renamed, "got 'of_tomorrow' at .*test_source_programs.py"),
    (with_more, r"got 'cumsum' \(with the parameters \['exclusive'\] .*test_source_programs.py"),
    (without("axis"), r"got 'cumsum' \(it has no parameter 'axis' .*test_source_programs.py"),
    call=lambda change: read_changed(sums, change),
    error=ValueError,
)
