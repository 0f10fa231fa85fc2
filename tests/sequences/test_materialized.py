"""Points in great numbers: tables and pieces give what the index gives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import Table, some

from qmcjax import sequences
from qmcjax.sequences._protocol import materialized

SEQUENCES = Table(
    {
        "sobol(2)": lambda: sequences.sobol(2),
        "sobol(9)": lambda: sequences.sobol(9),
        "sobol(19)": lambda: sequences.sobol(19),
        "halton(2)": lambda: sequences.halton(2),
        "gray": lambda: sequences.gray(sequences.sobol(9)),
        "gray of owen": lambda: sequences.gray(sequences.owen(sequences.sobol(9), key=1)),
        "owen of gray": lambda: sequences.owen(sequences.gray(sequences.sobol(9)), key=1),
        "matousek of xor": lambda: sequences.linear_matrix_scramble(
            sequences.digital_shift(sequences.sobol(2), key=1), key=2
        ),
        "owen_exact": lambda: sequences.owen_exact(sequences.sobol(2), key=1),
    }
)


@some("sequence", SEQUENCES, "sobol(9)", "halton(2)", "gray of owen", "owen_exact")
def test_tables_give_the_points_of_the_indices(sequence):
    n, start = 4999, 2**31 + 512
    index = np.arange(start, start + n, dtype=np.uint32)
    assert np.array_equal(sequence.points(n, start), sequence(index))


def test_the_last_block_may_end_beyond_the_last_index():
    index = np.arange(2**32 - 5120, 2**32 - 7, dtype=np.uint32)
    assert np.array_equal(sequences.sobol(2).points(5113, 2**32 - 5120), sequences.sobol(2)(index))


@pytest.fixture
def small_pieces(monkeypatch):
    monkeypatch.delenv("GLIBC_TUNABLES", raising=False)
    monkeypatch.setattr(materialized, "_LARGE", 2**10)
    monkeypatch.setattr(materialized, "_CHUNK", 2**16)


@pytest.mark.parametrize("name, dtype", [("sobol(9)", jnp.float32), ("halton(2)", jnp.float64)])
def test_pieces_give_the_points_of_the_indices(small_pieces, name, dtype):
    sequence = SEQUENCES[name]
    index = np.arange(256, 256 + 10001, dtype=np.uint32)
    points = sequence.points(10001, 256, dtype)
    assert isinstance(points, jax.Array)
    assert points.dtype == dtype
    with jax.enable_x64(dtype == jnp.float64):
        assert np.array_equal(points, sequence(index, dtype=dtype))


def test_pieces_are_not_copied_again(small_pieces):
    made = []

    def make(first, count):
        made.append((first, count))
        return jnp.full((count, 2), first, jnp.float32)

    rows = materialized.materialized(make, 20000, 2, jnp.float32)
    assert made == [(0, 8192), (8192, 8192), (16384, 3616)]
    assert np.array_equal(np.unique(np.asarray(rows)), [0, 8192, 16384])
    assert rows.unsafe_buffer_pointer() % 64 == 0


def test_pieces_are_not_made_inside_a_program(small_pieces):
    sequence = SEQUENCES["sobol(9)"]
    inside = jax.jit(lambda: sequence.points(10001))()
    assert np.array_equal(inside, sequence.points(10001))


def test_the_environment_decides(small_pieces, monkeypatch):
    monkeypatch.setenv("GLIBC_TUNABLES", "glibc.malloc.check=1:glibc.malloc.hugetlb=1")
    calls = []
    materialized.materialized(
        lambda first, count: calls.append(count) or jnp.zeros((count, 2)), 20000, 2, jnp.float32
    )
    assert calls == [20000]
