"""Sequences of users: objects without decorators, functions, and what is refused."""

from dataclasses import dataclass, field

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import qmc
from tables import first, slow, some

import qmcjax as qj
from qmcjax import integrate, orders, samplers, sequences
from qmcjax.core.bits import reverse, to_unit

N = 64


class Selecting:
    """The Sobol' sequence in two dimensions, by the whole protocol."""

    dims = 2

    def __call__(self, index, dims, dtype):
        return sequences.sobol(2)(index, dims, dtype)


class Simple:
    """The same, all coordinates at once in whatever dtype."""

    dims = 2
    size = N

    def __call__(self, index):
        return sequences.sobol(2)(index, dtype=jnp.float32)


@qj.pytree
@dataclass(frozen=True)
class Shifted:
    """Van der Corput's sequence, shifted by an array that is an argument of the program."""

    shift: jax.Array
    dims = 1

    def __call__(self, index):
        return to_unit(reverse(index) ^ self.shift)[..., None]


MADE = sequences.function(sequences.sobol(2), 2)
OBJECTS = {"selecting": Selecting(), "simple": Simple(), "function": MADE}
SOBOL = sequences.sobol(2)


@some("thing", OBJECTS, "selecting", "simple")
@pytest.mark.parametrize("dtype", [jnp.float64, *slow(jnp.float32)])
def test_an_object_is_a_sequence(thing, dtype):
    seq = sequences.as_sequence("sequence", thing)
    expected = np.asarray(SOBOL.points(N)).astype(dtype)  # of few digits: float32 has them all
    assert np.array_equal(seq.points(N, dtype=dtype), expected)
    assert np.array_equal(seq(first(N).reshape(8, 8), (1,), dtype), expected[:, 1:].reshape(8, 8, 1))
    with jax.enable_x64(dtype == jnp.float64):
        assert np.array_equal(seq.coordinate(jnp.asarray(first(N)), 0, dtype), expected[:, 0])
    assert sequences.as_sequence("sequence", seq) is seq


@some("thing", OBJECTS, "simple")
def test_an_object_goes_wherever_a_sequence_does(thing):
    def same(make):
        assert np.array_equal(make(thing), make(SOBOL))

    same(lambda s: sequences.rotate(s, [0.5, 0.25]).points(N))
    same(lambda s: sequences.components(s, (1,)).points(N))
    same(lambda s: integrate(lambda p: p[:, 0] * p[:, 1], s, N))
    x = first(4)
    same(lambda s: samplers.contiguous(orders.hilbert(4, 4), sequences.as_sequence("s", s), 4)(x, x, 1))


def test_an_object_compiles_once_and_new_arrays_compile_nothing():
    traces = []

    @jax.jit
    def points(seq):
        traces.append(1)
        return seq(first(N))

    thing = Selecting()
    for _ in range(2):
        points(sequences.as_sequence("sequence", thing))
    assert len(traces) == 1
    for shift in (0, 2**31):
        moved = points(sequences.as_sequence("sequence", Shifted(jnp.uint32(shift))))
        assert float(moved[0, 0]) == shift / 2**32
    assert len(traces) == 2


WRONG = {
    r"float32 \(4, 2\) for indices \(4,\), got float32 \(4, 3\)": lambda index: jnp.zeros((*index.shape, 3)),
    r"got float32 \(4,\)": lambda index: jnp.zeros(index.shape),
    r"got uint32 \(4, 2\)": lambda index: jnp.zeros((*index.shape, 2), jnp.uint32),
    "got 0.5": lambda index: 0.5,
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_points_are_seen_while_tracing(message):
    class Wrong(Simple):
        def __call__(self, index, dims=None, dtype=None):
            return WRONG[message](index)

    seq = sequences.as_sequence("sequence", Wrong())
    with pytest.raises(ValueError, match=f"sequence must return points of .*{message}"):
        jax.eval_shape(seq, jnp.asarray(first(4)))


class HasArray(Simple):
    def __init__(self, table):
        self.table = table


@dataclass
class Named(Simple):
    """An object that equals others of its name, whatever their points are."""

    name: str
    shift: int = field(compare=False)


@pytest.mark.parametrize("value", [qmc.Sobol(2), samplers.independent(SOBOL, 1), Simple, np.zeros((3, 2))])
def test_other_things_are_refused(value):
    with pytest.raises(TypeError, match=r"sequence must be a sequence \(have dims and a .*\), got ") as info:
        sequences.as_sequence("sequence", value)
    assert ("sequences.tabulated(engine.random(n))" in str(info.value)) == isinstance(value, qmc.QMCEngine)


@pytest.mark.parametrize("table", [np.zeros(3), jnp.zeros(3), [1, np.zeros(3)], {"deep": (np.zeros(3),)}])
def test_arrays_want_a_pytree(table):
    """Those inside of lists, tuples and dictionaries, too."""
    with pytest.raises(TypeError, match=r"must be a pytree to have an array .* 'table'"):
        sequences.as_sequence("sequence", HasArray(table))


def test_objects_equal_only_themselves():
    """Programs of one are not those of another, whatever their classes say of equality."""
    one, other = Named("a", 1), Named("a", 2)
    assert one == other
    held = [sequences.as_sequence("sequence", value) for value in (one, one, other)]
    same, _, differs = map(jax.tree.structure, held)
    assert held[0] == held[1] and same == jax.tree.structure(held[1])
    assert held[0] != held[2] and same != differs


@pytest.mark.parametrize("index", [[0, 3], np.arange(4), np.arange(4, dtype="i1"), jnp.arange(4), 3])
def test_any_integer_is_an_index(index):
    assert np.array_equal(SOBOL(index), SOBOL(np.asarray(index).astype(np.uint32)))
    assert np.array_equal(SOBOL.bits(index), SOBOL.bits(np.asarray(index).astype(np.uint32)))


SIZED = {"net": sequences.hammersley_net(5), "lattice": sequences.rank1_lattice(21), "plain object": Simple()}


@some("seq", SIZED, "lattice")
def test_sequences_with_a_size_have_length_slices_and_points(seq):
    seq = sequences.as_sequence("sequence", seq)
    points = np.asarray(seq.points(seq.size))
    assert len(seq) == seq.size and bool(seq)
    for part in ((None,), (2, 10), (-3, None), (None, None, -5), (4, 4), (30, 2)):
        assert np.array_equal(seq[slice(*part)], points[slice(*part)])
    assert np.array_equal(seq[3], points[3]) and np.array_equal(seq[-1], points[-1])
    assert np.array_equal(np.stack([*seq]), points)
    with pytest.raises(ValueError, match=rf"index must be an integer .* got {seq.size}"):
        seq[seq.size]
    with pytest.raises(TypeError, match="index must be an integer"):
        seq[0.5]


@pytest.mark.parametrize("use", [len, iter, lambda seq: seq[2:10], lambda seq: seq[0]])
def test_unbounded_sequences_have_neither(use):
    assert bool(SOBOL)
    with pytest.raises(TypeError, match=r"sobol\(dims=2\) has no last point: use its .points\(n\)"):
        use(SOBOL)
    with pytest.raises(TypeError, match="is not an array"):
        np.asarray(SOBOL)
