"""The objects that share tests."""

import os
import re
import socket
import sys
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import orders, samplers, sequences
from qmcjax.core import backends
from qmcjax.orders._hierarchy import permuted


class Table(Mapping):
    """Objects by their names, each made when it is first asked for: to collect tests makes none."""

    def __init__(self, makers: Mapping[str, Callable[[], Any]]):
        self._makers, self._made = dict(makers), {}

    def __getitem__(self, name):
        if name not in self._made:
            self._made[name] = self._makers[name]()
        return self._made[name]

    def __iter__(self):
        return iter(self._makers)

    def __len__(self):
        return len(self._makers)

    def __or__(self, other):
        return Table({name: partial(table.__getitem__, name) for table in (self, other) for name in table})

    def without(self, names):
        return Table({name: partial(self.__getitem__, name) for name in self if name not in names})


def names(text):
    """Return the names of a text, with semicolons between them."""
    return tuple(re.split(r";\s", text.strip()))


sobol, halton, owen, scramble = (
    getattr(sequences, name) for name in ("sobol", "halton", "owen", "linear_matrix_scramble")
)
SEQUENCES = Table(
    {
        "van_der_corput(2)": sequences.van_der_corput,
        "van_der_corput(7)": lambda: sequences.van_der_corput(7),
        "van_der_corput(65536)": lambda: sequences.van_der_corput(65536),
        "sobol(1)": lambda: sequences.sobol(1),
        "sobol(2)": lambda: sequences.sobol(2),
        "sobol(9)": lambda: sequences.sobol(9),
        "larcher_pillichshammer": sequences.larcher_pillichshammer,
        "digital": lambda: sequences.digital(sequences.sobol(4).matrices),
        "halton(3)": lambda: sequences.halton(3),
        "halton(12)": lambda: sequences.halton(12),
        "halton, zaremba": lambda: sequences.halton(5, "zaremba"),
        "halton, faure_lemieux": lambda: sequences.halton(10, "faure_lemieux"),
        "halton, random": lambda: sequences.halton(5, "random", key=7),
        "faure(10)": lambda: sequences.faure(10),
        "faure(2, modified)": lambda: sequences.faure(2, modified=1),
        "faure(5, modified)": lambda: sequences.faure(5, 7, modified=0),
        "quad_optimized(6)": lambda: sequences.quad_optimized(6),
        "uniform(3)": lambda: sequences.uniform(3, key=7),
        "jittered(40)": lambda: sequences.jittered(40, 2, key=7),
        "jittered(64)": lambda: sequences.jittered(64, 2, key=7),
        "jittered(16, 3)": lambda: sequences.jittered(16, 3, key=7),
        "hammersley_net(12)": lambda: sequences.hammersley_net(12),
        "larcher_pillichshammer_net(12)": lambda: sequences.larcher_pillichshammer_net(12),
        "permutation_net(11)": lambda: sequences.permutation_net(11),
        "permutation_net(12)": lambda: sequences.permutation_net(12),
        "owen(sobol(2))": lambda: sequences.owen(sequences.sobol(2), key=7),
        "owen(sobol(9))": lambda: sequences.owen(sequences.sobol(9), key=7),
        "owen(permutation_net(12))": lambda: sequences.owen(sequences.permutation_net(12), key=7),
        "optimized_net(12)": lambda: sequences.optimized_net(12),
        "sobol_of": lambda: sequences.sobol_of([(0b111, [1, 3]), (0b1011, [1, 1, 7])]),
        "one_two(6)": lambda: sequences.one_two(6),
        "niederreiter_xing(5)": lambda: sequences.niederreiter_xing(5),
        "sz(4)": lambda: sequences.sz(4),
        "sz(16)": lambda: sequences.sz(16),
        "optimized_sequence": sequences.optimized_sequence,
        "cascaded_net(12)": lambda: sequences.cascaded_net(12, 4),
        "sobol_net_3d(12)": lambda: sequences.sobol_net_3d(12),
        "larcher_pillichshammer_net_3d(12)": lambda: sequences.larcher_pillichshammer_net_3d(12),
        "permutation_net_3d(11)": lambda: sequences.permutation_net_3d(11),
        "digital_shift(sobol(2))": lambda: sequences.digital_shift(sequences.sobol(2), key=7),
        "linear_matrix_scramble(sobol(9))": lambda: scramble(sobol(9), key=7),
        "linear_matrix_scramble(permutation_net(12))": lambda: scramble(sequences.permutation_net(12), key=7),
        "owen_exact(sobol(2))": lambda: sequences.owen_exact(sequences.sobol(2), key=7),
        "owen_exact(sobol(9))": lambda: sequences.owen_exact(sequences.sobol(9), key=7),
        "art_owen(sobol(2))": lambda: sequences.art_owen(sequences.sobol(2), key=7),
        "art_owen(sobol(33))": lambda: sequences.art_owen(sequences.sobol(33), key=7),
        "rotate(sobol(9))": lambda: sequences.rotate(sequences.sobol(9), np.linspace(0.05, 0.95, 9)),
        "rotate(halton(12))": lambda: sequences.rotate(sequences.halton(12), np.linspace(0.05, 0.95, 12)),
        "lattice(3)": lambda: sequences.lattice(3),
        "lattice(20)": lambda: sequences.lattice(20),
        "kronecker(3)": lambda: sequences.kronecker([2**0.5 % 1, 3**0.5 % 1, 5**0.5 % 1]),
        "roberts(2)": sequences.roberts,
        "korobov(2000)": lambda: sequences.korobov(2000, 3, 747),
        "rank1_lattice(4096)": lambda: sequences.rank1_lattice(4096),
        "rank1_lattice(1700, 3)": lambda: sequences.rank1_lattice(1700, 3),
        "latin_hypercube(1601)": lambda: sequences.latin_hypercube(1601, 3, key=7),
        "latin_hypercube(2**32)": lambda: sequences.latin_hypercube(2**32, 2, key=7),
        "lloyd(1600)": lambda: sequences.lloyd(1600, 2, key=7, iterations=3),
        "net_by_net(sobol(3))": lambda: sequences.net_by_net(sequences.sobol(3), 4096, key=7),
        "net_by_net(halton(3))": lambda: sequences.net_by_net(sequences.halton(3), 2000, key=7),
        "net_by_net(faure(3))": lambda: sequences.net_by_net(sequences.faure(3), 2187, key=7),
        "pmj02(2048)": lambda: sequences.pmj02(2048, key=7),
        "owen(halton(3))": lambda: sequences.owen(sequences.halton(3), key=7),
        "owen_exact(faure(3))": lambda: sequences.owen_exact(sequences.faure(3), key=7),
        "digit_scramble(halton(3))": lambda: sequences.digit_scramble(sequences.halton(3), key=7),
        "optimized_net_3d(12)": lambda: sequences.optimized_net_3d(12),
        "gray(sobol(2))": lambda: sequences.gray(sequences.sobol(2)),
        "gray(sobol(9))": lambda: sequences.gray(sequences.sobol(9)),
        "interlaced(sobol(4))": lambda: sequences.interlaced(sequences.sobol(4)),
        "interlaced(owen(sobol(6)), 3)": lambda: sequences.interlaced(owen(sobol(6), key=7), 3),
        "multi_jitter(1601)": lambda: sequences.multi_jitter(1601, key=7),
        "in_time(owen(sobol(3)))": lambda: sequences.in_time(owen(sobol(3), key=1)).at_frame(5),
    }
)

ORDERS = {
    "raster": orders.raster,
    "morton": orders.morton,
    "accordion": orders.accordion,
    "hilbert": orders.hilbert,
    "moore": orders.moore,
    "peano": orders.peano,
    "scrambled_morton, hash": partial(orders.scrambled_morton, key=7),
    "scrambled_morton, multiplicative": partial(orders.scrambled_morton, key=7, variant="multiplicative"),
    "scrambled_morton, tree": partial(orders.scrambled_morton, key=7, variant="tree"),
    "optimized": partial(orders.optimized, spp=4, key=7),
}

NETS = {name: getattr(sequences, f"{name}_net") for name in ("hammersley", "larcher_pillichshammer")}
NETS |= {name: getattr(sequences, f"{name}_net") for name in ("permutation", "optimized")}


# One of each kind: the types of an object and of its sequence, and on which side of FEW its coordinates are.
KINDS = names("""
in_time(owen(sobol(3))); cascaded_net(12); optimized_sequence; halton, random; sobol(9);
halton, faure_lemieux; faure(10); faure(5, modified); uniform(3); jittered(16, 3); permutation_net(12);
owen(sobol(2)); owen(sobol(9)); owen(permutation_net(12)); optimized_net(12);
larcher_pillichshammer_net_3d(12); permutation_net_3d(11); digital_shift(sobol(2));
linear_matrix_scramble(sobol(9)); linear_matrix_scramble(permutation_net(12)); owen_exact(sobol(2));
owen_exact(sobol(9)); art_owen(sobol(33)); art_owen(sobol(2)); rotate(sobol(9)); rotate(halton(12));
lattice(3); lattice(20); roberts(2); rank1_lattice(1700, 3); rank1_lattice(4096); latin_hypercube(2**32);
lloyd(1600); interlaced(sobol(4)); interlaced(owen(sobol(6)), 3); multi_jitter(1601); owen(halton(3));
owen_exact(faure(3)); digit_scramble(halton(3)); gray(sobol(2)); gray(sobol(9))
""")


BY_DEFAULT = {
    "sequences": names("""
sobol(9); halton, zaremba; faure(5, modified); uniform(3); permutation_net(12); owen(sobol(2));
art_owen(sobol(2)); rotate(halton(12)); rank1_lattice(1700, 3); latin_hypercube(2**32); owen(halton(3))
"""),
    "samplers": names("""
independent, owen; full_screen, permutation; contiguous, morton, owen; segments, hilbert, sobol, doubling;
partitioned, hilbert, halton; dither, vectors; ranked; tiled, boxes; z, tree
"""),
    "orders": ("hilbert", "scrambled_morton, hash"),
}
"""What tests of every object run with by default: each way of making points once."""


def each(argument, table):
    """Run a test with all objects of a table."""
    return some(argument, table, *table)


def some(argument, table, *names):
    """Run a test with a few objects of a table, the others on request; a ``Table``'s by ``conftest.py``."""
    lazy = isinstance(table, Table)
    taken = {name: partial(table.__getitem__, name) if lazy else table[name] for name in table}
    slowly = {name: () if name in names else pytest.mark.slow for name in table}
    marked = [pytest.param(of, id=name, marks=slowly[name]) for name, of in taken.items()]
    return pytest.mark.parametrize(argument, marked, indirect=lazy)


def slow(*cases):
    """Return cases of a test that run on request only."""
    return [pytest.param(case, marks=pytest.mark.slow) for case in cases]


def slow_cases(*cases):
    """Return such cases of several arguments each."""
    return [pytest.param(*case, marks=pytest.mark.slow) for case in cases]


def few(table, *names):
    """Return a few names of a table as they are, and the others to run on request."""
    return [*names, *slow(*(name for name in table if name not in names))]


def closest_square(points, side):
    """Return the smallest squared distance on the torus of this side, over all pairs, in Python integers."""
    delta = np.abs(points[:, None] - points).astype(object)
    return (np.minimum(delta, side - delta) ** 2).sum(axis=-1)[np.triu_indices(len(points), 1)].min()


def owen_pass(key):
    return samplers.contiguous(hilbert(), owen(sobol(3), key), 2)


def hilbert():
    return orders.hilbert(SIDE, SIDE)


def screen(sequence):
    return samplers.full_screen(sequence, SIDE, SIDE)


def tiles():
    return np.random.default_rng(1).random((8, 4, 2, 2, 2))


# Four samples in each of 32 x 32 pixels.
SIDE, SPP = 32, 4
contiguous, segments, partitioned, z = (
    getattr(samplers, name) for name in ("contiguous", "segments", "partitioned", "z")
)
SAMPLERS = Table(
    {
        "independent, owen": lambda: samplers.independent(sobol(2), key=3),
        "independent, xor": lambda: samplers.independent(sobol(2), key=3, randomize="xor"),
        "independent, shift": lambda: samplers.independent(halton(2), key=3, randomize="shift"),
        "independent, uniform": lambda: samplers.independent(sequences.uniform(2, key=1), key=3),
        "full_screen, hammersley": lambda: screen(sequences.hammersley_net(12)),
        "full_screen, larcher_pillichshammer": lambda: screen(sequences.larcher_pillichshammer_net(12)),
        "full_screen, permutation": lambda: screen(sequences.permutation_net(12)),
        "full_screen, xor": lambda: screen(
            sequences.digital_shift(sequences.larcher_pillichshammer_net(12), key=3)
        ),
        "full_screen, art": lambda: screen(sequences.art_owen(sobol(3), key=3)),
        "full_screen, halton": lambda: screen(halton(3)),
        "full_screen, halton, random": lambda: screen(halton(2, "random", key=3)),
        "padded_replications": lambda: samplers.padded_replications(
            sequences.hammersley_net(10), SIDE, SIDE, offsets=3
        ),
        "full_screen, jittered": lambda: screen(sequences.jittered(64, 2, key=3)),
        "contiguous, hilbert, sobol": lambda: contiguous(hilbert(), sobol(2), SPP),
        "contiguous, morton, owen": lambda: contiguous(orders.morton(SIDE, SIDE), owen(sobol(3), key=3), SPP),
        "contiguous, raster, halton": lambda: contiguous(orders.raster(SIDE, SIDE), halton(3), SPP),
        "segments, hilbert, halton": lambda: segments(
            hilbert(), sequences.components(halton(4), (2, 1, 3)), 2
        ),
        "segments, hilbert, sobol, doubling": lambda: segments(hilbert(), sobol(3), 1, doubling=True),
        "partitioned, hilbert, halton": lambda: partitioned(hilbert(), halton(4, "faure_lemieux")),
        "partitioned, peano, halton, exact": lambda: partitioned(
            orders.peano(SIDE, SIDE), halton(4, "random", key=3), exact=True
        ),
        "shifted, hilbert, lattice": lambda: samplers.shifted(
            hilbert(), halton(3, "faure_lemieux"), sequences.lattice(3)
        ),
        "dither, numbers": lambda: samplers.dither(samplers.blue_noise_mask(1), halton(3)),
        "window_lattice": lambda: samplers.window_lattice(sobol(4), key=3),
        "dither, vectors": lambda: samplers.dither(samplers.blue_noise_mask(2), sequences.lattice(3)),
        "interleaved": lambda: samplers.interleaved(sobol(3), SPP, tile=4),
        "interleaved, positions": lambda: samplers.interleaved(
            halton(1), SPP, 1, samplers.independent(sobol(2), key=3)
        ),
        "ranked": lambda: samplers.ranked(3, key=3),
        "randomized, contiguous, owen": lambda: samplers.randomized(owen_pass, key=3),
        "optimized": lambda: samplers.optimized(SIDE, SIDE, SPP, key=3),
        "optimized, joint": lambda: samplers.optimized(SIDE, SIDE, SPP, key=3, dims=3),
        "progressive": lambda: samplers.progressive(SIDE, SIDE, key=3, dims=2),
        "progressive, groups": lambda: samplers.progressive(SIDE, SIDE, key=3, dims=6),
        "designed": lambda: samplers.designed(SIDE, SIDE, SPP, key=3, dims=3),
        "tiled, boxes": lambda: samplers.tiled(tiles(), 3, dims=3, spp=SPP).at_frame(1),
        "z, hash": lambda: z(SIDE, SIDE, SPP, key=3, dims=3),
        "z, frames": lambda: z(SIDE, SIDE, SPP, key=3, dims=3, frames=8).at_frame(5),
        "contiguous, hilbert3": lambda: contiguous(
            orders.hilbert3(SIDE, SIDE, 4), owen(sobol(3), key=3), SPP
        ).at_frame(3),
        "z, tree": lambda: z(SIDE, SIDE, SPP, 3, "tree", sequence=owen(sobol(3), key=3)),
        "split": lambda: z(SIDE, SIDE, SPP // 2, key=3, dims=3).split((1, 2), 2),
        "z, plain, counts": lambda: z(SIDE, SIDE, SPP, None, "plain").adaptive([[SPP] * SIDE] * SIDE),
    }
)


def known(value):
    """Return the classes of a value and the bits of its arrays."""
    leaves = jax.tree.leaves(value, is_leaf=lambda leaf: leaf is None)
    keys = [jnp.issubdtype(getattr(leaf, "dtype", None), jax.dtypes.prng_key) for leaf in leaves]
    leaves = [jax.random.key_data(leaf) if key else leaf for leaf, key in zip(leaves, keys, strict=True)]
    return str(jax.tree.structure(value)), [np.asarray(leaf).tobytes() for leaf in leaves]


def first(n: int) -> np.ndarray:
    """Return the first n indices."""
    return np.arange(n, dtype=np.uint32)


def again(array: np.ndarray, n: int) -> jax.Array:
    """Return the flat array over and over, up to n entries: in one shape, operations compile but once."""
    return jnp.asarray(np.resize(array, n))


def boxes(bits: np.ndarray, m: int, i: int) -> np.ndarray:
    """Return the number of the elementary interval 2**-i x 2**-(m - i) that each point lies in."""
    bits = bits.astype(np.uint64)
    return (bits[:, 0] >> np.uint64(32 - i)) << np.uint64(m - i) | (bits[:, 1] >> np.uint64(32 - m + i))


def is_net(bits: np.ndarray, m: int) -> bool:
    """Tell whether each elementary interval of area 2**-m holds one of the 2**m points, t = 0."""
    counts = (np.bincount(boxes(bits, m, i).astype(np.int64), minlength=2**m) for i in range(m + 1))
    return all(np.all(count == 1) for count in counts)


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def environment(**more):
    """Return the environment of processes that import tests, and that share compiled programs with them."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(sys.path),
        "JAX_COMPILATION_CACHE_DIR": str(jax.config.values["jax_compilation_cache_dir"]),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        **more,
    }


def sizes(monkeypatch, backend=backends.CPU, **changed):
    """Let programs have other sizes: those of a GPU, for example."""
    monkeypatch.setitem(backends.BY_PLATFORM, "cpu", backend._replace(**changed))


def pixels(width, height, spp=1, start=0):
    """Return every x, y, sample of an image, pixel by pixel."""
    shape = first(height), first(width), first(spp) + np.uint32(start)
    y, x, sample = (jnp.asarray(a.ravel()) for a in np.meshgrid(*shape, indexing="ij"))
    return x, y, sample


@partial(jax.jit, static_argnames=("dims", "dtype"))
def points_of(sampler, x, y, sample, dims=(0, 1), dtype=jnp.float64):
    """Return points of samples, by one program instead of many small ones."""
    with jax.enable_x64(True):
        return sampler(x, y, sample, dims, dtype)


@cache
def permutations_of_4():
    """Return the permutations of four by their numbers."""
    every = jnp.broadcast_arrays(jnp.arange(24, dtype=jnp.uint32)[:, None], first(4))
    return np.asarray(permuted(*every)).tolist()


def grammar(order):
    """Return the root, the permutation of the children of a node, and the child, in Python integers."""

    def triple32(word):
        word = (word ^ word >> 17) * 0xED5AD4BB % 2**32
        word = (word ^ word >> 11) * 0xAC4C1B51 % 2**32
        word = (word ^ word >> 15) * 0x31848BAB % 2**32
        return word ^ word >> 14

    golden, numbered = 0x9E3779B9, permutations_of_4()
    if hasattr(order, "seed"):
        child = lambda node, digit: triple32((node + (digit + 1) * golden) % 2**32)  # noqa: E731
        return int(order.seed), lambda node: numbered[node * 24 >> 32], child
    if hasattr(order, "dim"):
        mask = 0x55555555 * int(order.dim) % 2**32
        place = lambda node: numbered[((node ^ mask) * golden % 2**32) * 24 >> 32]  # noqa: E731
        return 0, place, lambda node, digit: (4 * node + digit) % 2**32
    production, numbers = np.asarray(order.production).tolist(), np.asarray(order.permutations).tolist()
    shift, letters = int(getattr(order, "shift", 0)), len(production)
    child = lambda node, digit: production[(node + shift) % letters][digit]  # noqa: E731
    return 0, lambda node: numbered[numbers[node]], child


def digit_count(base):
    """Return the number of digits of an index."""
    return next(k for k in range(33) if base**k >= 2**32)


def reflected(index, base):
    """Return phi_b as an exact fraction, Hilbert paper, Eq. 1."""
    numerator, denominator = 0, 1
    while index:
        index, digit = divmod(index, base)
        numerator, denominator = numerator * base + digit, denominator * base
    return Fraction(numerator, denominator)


def compositions(total, parts):
    """Return all tuples of numbers from 0 on with a sum."""
    if parts == 1:
        return [(total,)]
    return [(d, *rest) for d in range(total + 1) for rest in compositions(total - d, parts - 1)]


def chi_squared(numbers, count):
    """Return by how many standard deviations chi-squared is off its mean."""
    expected = len(numbers) / count
    statistic = ((np.bincount(numbers, minlength=count) - expected) ** 2 / expected).sum()
    return abs(statistic - (count - 1)) / np.sqrt(2 * (count - 1))


def pairs_are_uniform(points, pairs, bins):
    """Assert that, in squares of two coordinates, chi-squared is at most 5 deviations off, for some pairs."""
    cells = (np.asarray(points) * bins).astype(int)
    for one, other in pairs:
        assert chi_squared(cells[:, one] * bins + cells[:, other], bins**2) < 5, (one, other)


def reversed_bits(number, digits):
    """Return a number with its binary digits backwards."""
    return int(f"{number:0{digits}b}"[::-1], 2)
