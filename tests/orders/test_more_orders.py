"""Accordion, Moore, Peano and scrambled Morton orders: their definitions, and how random they are."""

from functools import partial
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from tables import first, grammar, permutations_of_4

from qmcjax import orders
from qmcjax.core.number_theory import word_factors
from qmcjax.orders._hierarchy import _MATRICES, unpermuted
from qmcjax.orders._scrambled_morton import LookupTree, art_production

VARIANTS = {
    "hash": orders.scrambled_morton,
    "multiplicative": partial(orders.scrambled_morton, variant="multiplicative"),
    "tree": partial(orders.scrambled_morton, variant="tree"),
    "art": partial(orders.scrambled_morton, variant="art"),
}
each_variant = pytest.mark.parametrize("make", VARIANTS.values(), ids=VARIANTS.keys())
HIERARCHICAL = {name: getattr(orders, name) for name in ("accordion", "hilbert", "moore", "morton")} | {
    name: partial(make, key=3) for name, make in VARIANTS.items()
}
HIERARCHICAL["optimized"] = partial(orders.optimized, spp=1, key=3)
GOLDEN_RATIO = (1 + 5**0.5) / 2


def pixels(order, start=0, count=None):
    """Pixels along the curve, one row each."""
    position = jnp.asarray(first(order.length if count is None else count) + np.uint32(start))
    return np.stack(jax.jit(lambda o, p: o.pixel(p))(order, position), axis=1).astype(np.int64)


def positions(order):
    """Positions of all pixels of the raster, as an image."""
    columns, rows = order.raster
    x, y = (jnp.asarray(v.astype(np.uint32)) for v in np.meshgrid(np.arange(columns), np.arange(rows)))
    return np.asarray(jax.jit(lambda o, x, y: o.position(x, y))(order, x, y))


def fold(strip, first_to):
    """Turn bars of 2 h by h pixels of a strip up and down in turn; ``first_to`` is 1 if the first goes up."""
    height, length = strip.shape
    bars = strip.reshape(height, length // (2 * height), 2 * height).transpose(1, 0, 2)
    turned = [bar[::-1].T if i % 2 != first_to else bar[:, ::-1].T for i, bar in enumerate(bars)]
    return np.concatenate(turned, axis=1)


@pytest.mark.parametrize("k", [0, 1, 2, 3, 6])
def test_accordion_is_a_folded_strip(k):
    """The Z paper's Fig. 4 backwards: from the strip of all pixels to the square."""
    strip = np.arange(4**k).reshape(1, -1)
    for step in range(k, 0, -1):
        strip = fold(strip, step % 2)
    assert np.array_equal(positions(orders.accordion(2**k, 2**k)), strip.T)


def test_moore_equals_its_l_system():
    """L -> -RF+LFL+FR-, R -> +LF-RFR-FL+ from LFL+F+LFL: a turtle, told nothing of Hilbert curves."""
    rules, word = {"L": "-RF+LFL+FR-", "R": "+LF-RFR-FL+"}, "LFL+F+LFL"
    for k in range(1, 5):
        place, heading, path = 2 ** (k - 1) - 1 + (2**k - 1) * 1j, -1j, []
        path.append(place)
        for letter in word:
            heading *= {"+": 1j, "-": -1j}.get(letter, 1)
            if letter == "F":
                place += heading
                path.append(place)
        curve = pixels(orders.moore(2**k, 2**k))
        upwards = np.stack([curve[:, 0], 2**k - 1 - curve[:, 1]], axis=1)
        assert np.array_equal(upwards, [(round(p.real), round(p.imag)) for p in path])
        word = "".join(rules.get(letter, letter) for letter in word)


@pytest.mark.parametrize("k", [0, 1, 2, 4])
def test_peano_equals_its_grammar(k):
    """Nine copies, three columns down, up and down: mirrored sideways in row 1, upside down in column 1."""
    curve = np.array([[0, 0]])
    for level in range(k):
        side, (x, y), parts = 3**level, curve.T, []
        for i in range(3):
            for j in range(3) if i % 2 == 0 else range(2, -1, -1):
                across, down = side - 1 - x if j % 2 else x, side - 1 - y if i % 2 else y
                parts.append(np.stack([i * side + across, j * side + down], axis=1))
        curve = np.concatenate(parts)
    assert np.array_equal(pixels(orders.peano(3**k, 3**k)), curve)


MAX = orders.MAX_SIDE
CONTINUOUS = [
    *((orders.hilbert, side, lambda n: (n - 1, 0)) for side in (2, 4, 8, 16, 512, MAX)),
    *((orders.moore, side, lambda n: (1, 0)) for side in (2, 512, MAX)),
    *((orders.peano, side, lambda n: (n - 1, n - 1)) for side in (3, 729, orders.PEANO_SIDE)),
]


@pytest.mark.parametrize(("make", "side", "end"), CONTINUOUS)
def test_steps_go_to_neighbours(make, side, end):
    """From one corner to another; around and back to the pixel beside the first on Moore's curve."""
    order, last = make(side, side), side**2 - 1
    assert (order.raster, order.length) == ((side, side), side**2)
    start = np.random.default_rng(1).integers(0, last, 20000) if side > 1000 else np.arange(last)
    start = np.append(start, [0, last - 1]).astype(np.uint32)
    pixel = jax.jit(lambda o, p: jnp.stack(o.pixel(p)))
    here, there = (np.asarray(pixel(order, p)).astype(np.int64) for p in (start, start + np.uint32(1)))
    assert np.all(np.abs(here - there).sum(axis=0) == 1)
    assert (there[:, -1] - here[:, -2]).tolist() == list(end(side))


@pytest.mark.parametrize("make", HIERARCHICAL.values(), ids=HIERARCHICAL.keys())
def test_aligned_blocks_hold_aligned_runs(make):
    """The quadtree property on all levels: in whole for 64 x 64 pixels, sampled for 65536 x 65536."""
    table = positions(make(64, 64))
    assert np.array_equal(np.unique(table), np.arange(64**2))
    for k in range(7):
        blocks = (table >> np.uint32(2 * k)).reshape(64 >> k, 2**k, 64 >> k, 2**k)
        assert np.all(blocks == blocks[:, :1, :, :1])
    rng = np.random.default_rng(2)
    k = rng.integers(0, 17, 10**4)
    pixel = rng.integers(0, 2**16, (2, 10**4))
    neighbour = pixel ^ rng.integers(0, 2**k, (2, 10**4))
    order = make(2**16, 2**16)
    position = jax.jit(lambda o, pixel: o.position(pixel[0], pixel[1]))
    here, there = (
        np.asarray(position(order, p.astype(np.uint32))).astype(np.int64) for p in (pixel, neighbour)
    )
    assert np.all((here ^ there) >> (2 * k) == 0)


def test_numbers_are_all_permutations_and_invertible():
    assert len(_MATRICES) == 6
    numbers = permutations_of_4()
    assert sorted(map(tuple, numbers)) == list(permutations(range(4)))
    number, digit = np.broadcast_arrays(first(24)[:, None], first(4))
    assert np.array_equal(unpermuted(jnp.asarray(number), jnp.asarray(np.uint32(numbers))), digit)


@each_variant
def test_scrambled_morton_equals_its_recursion(make):
    """Draw the quadrants in the permuted order, each as a scrambled square of its own: Eq. 5."""
    order = make(16, 16, key=11)
    root, permutation, child = grammar(order)

    def curve(node, x, y, side):
        if side == 1:
            return [(x, y)]
        place = permutation(node)
        drawn = []
        for digit in sorted(range(4), key=place.__getitem__):
            half = side // 2
            drawn += curve(child(node, digit), x + half * (digit & 1), y + half * (digit >> 1), half)
        return drawn

    expected = np.array(curve(root, 0, 0, 16))
    assert np.array_equal(pixels(order), expected)
    assert np.array_equal(positions(order)[expected[:, 1], expected[:, 0]], first(256))


def test_multiplicative_hash_is_the_printed_one():
    """Without d, Eq. 8 in float64 gives the same permutation for the first prefixes."""
    order = orders.scrambled_morton(64, 64, key=0, variant="multiplicative")
    prefix = first(4**5)
    printed = (prefix * GOLDEN_RATIO % 1 * 24).astype(int)
    assert np.array_equal(order._permutation(jnp.asarray(prefix)), printed)


@each_variant
def test_digits_go_on_below_the_pixels(make):
    """Eq. 16: permuting the digits of pixel and sample one after the other is permuting them together."""
    order = make(32, 32, key=5)
    code = np.random.default_rng(3).integers(0, 4**8, 500, dtype=np.uint32)
    together, _ = order.scrambled(jnp.asarray(code), 8)
    pixel, node = order.scrambled(jnp.asarray(code >> 6), 5)
    sample, _ = order.scrambled(jnp.asarray(code & 63), 3, node)
    assert np.array_equal(together, pixel << 6 | sample)
    assert np.array_equal(order.scrambled(0, 0)[0], 0)


KEYS = 1000


def child_permutations(make, side, keys):
    """Return the permutation, one of 24, of the children of each node for some keys: an array a level."""
    codes = orders.morton(side, side).pixel(jnp.asarray(first(side * side)))
    of_key = jax.vmap(lambda key, x, y: make(side, side, key).position(x, y), in_axes=(0, None, None))
    position = np.asarray(jax.jit(of_key)(keys, *codes))
    levels, rank = side.bit_length() - 1, {p: i for i, p in enumerate(permutations(range(4)))}
    table = np.zeros((4, 4, 4, 4), np.int64)
    for p, i in rank.items():
        table[p] = i
    nodes = []
    for level in range(levels):
        below = 2 * (levels - level - 1)
        children = (position[:, :: 1 << below] >> np.uint32(below)) & np.uint32(3)
        nodes.append(table[tuple(np.moveaxis(children.reshape(len(keys), 4**level, 4), 2, 0))])
    return nodes


@pytest.fixture(scope="module")
def drawn():
    keys = jax.random.split(jax.random.key(17), KEYS)
    return {name: child_permutations(make, 16, keys) for name, make in VARIANTS.items()}


def chi_square(counts):
    """Chi-square of counts that should be equal, and its degrees of freedom."""
    expected = counts.mean(axis=-1, keepdims=True)
    return np.sum((counts - expected) ** 2 / expected, axis=-1), counts.shape[-1] - 1


def is_uniform(counts):
    """Tell whether the largest of some chi-squares is within 5 sigma (one-sided, for as many trials)."""
    chance = stats.chi2.sf(*chi_square(counts))
    return np.min(chance) > stats.norm.sf(5) / np.size(chance)


@pytest.mark.slow
@pytest.mark.parametrize("name", VARIANTS)
def test_all_24_permutations_are_equally_likely_at_each_node(drawn, name):
    """Over the keys, at each of 85 nodes; and over nodes and keys, where nodes are independent."""
    nodes = np.concatenate(drawn[name], axis=1).T
    counts = np.stack([np.bincount(node, minlength=24) for node in nodes])
    assert counts.shape == (85, 24)
    assert is_uniform(counts)
    if name != "multiplicative":
        assert is_uniform(counts.sum(axis=0))


@pytest.mark.slow
def test_all_24_permutations_are_equally_likely_over_the_nodes():
    """For one key: by chance for the hash, as evenly as can be for the multiples of the golden ratio."""
    by_chance, evenly = (
        np.bincount(child_permutations(VARIANTS[name], 256, jax.random.split(jax.random.key(8), 1))[7][0])
        for name in ("hash", "multiplicative")
    )
    assert is_uniform(by_chance)
    assert 5 < chi_square(by_chance)[0] < 60
    assert np.ptp(evenly) <= 8


def pairs_of_neighbours(nodes):
    """Permutations of nodes that are next to each other in the tree or on the screen, no node twice."""
    parents, children = nodes[2], nodes[3].reshape(KEYS, 4, 4, 4)
    return {
        "siblings": (children[..., 0], children[..., 1]),
        "siblings, vertically": (children[..., 1], children[..., 3]),
        "cousins": (children[:, :, 0, 1], children[:, :, 1, 0]),
        "parent and child": (parents, nodes[3][:, ::4]),
        "same place, two keys": (nodes[3][::2], nodes[3][1::2]),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hash", "tree", "art"])
def test_neighbouring_nodes_are_independent(drawn, name):
    for a, b in pairs_of_neighbours(drawn[name]).values():
        assert is_uniform(np.bincount((24 * a + b).ravel(), minlength=576))


@pytest.mark.slow
def test_neighbouring_nodes_of_the_multiplicative_hash_are_not():
    """Siblings are one step of the golden ratio apart: 14 or 15 of 24, and never the same."""
    for d in range(4):
        node = first(4**6)[::2]
        order = orders.scrambled_morton(4, 4, key=d, variant="multiplicative")
        a, b = (
            np.asarray(order._permutation(jnp.asarray(n))).astype(int) for n in (node, node + np.uint32(1))
        )
        assert np.unique((b - a) % 24).tolist() == ([9, 10] if d % 2 else [14, 15])


def test_a_single_letter_permutes_all_nodes_alike():
    """Each level adds the same permutation: the order is a power of the one of 2 x 2 pixels."""
    small, large = (positions(orders.scrambled_morton(n, n, 4, "tree", alphabet=1)) for n in (2, 8))
    power = small
    for _ in range(2):
        power = np.kron(power, np.full((2, 2), 4, np.uint32)) + np.tile(small, (len(power), len(power)))
    assert np.array_equal(large, power)


def lookup_tree(key, variant="tree", alphabet=None):
    order = orders.scrambled_morton(4, 4, key, variant, alphabet)
    assert isinstance(order, LookupTree)
    return order


@pytest.mark.parametrize("alphabet", [3, 65536])
def test_random_production_draws_from_the_whole_alphabet(alphabet):
    order = lookup_tree(6, alphabet=alphabet)
    production = np.asarray(order.production)
    assert production.shape == (alphabet, 4)
    assert order.permutations.shape == (alphabet,)
    # 16 ranges of letters, or all.
    share = max(alphabet // 16, 1)
    counts = np.bincount(production.ravel() // share, minlength=alphabet // share)
    assert len(counts) == alphabet // share
    assert is_uniform(counts) if alphabet > 3 else production.max() == alphabet - 1


def test_production_and_permutations_are_drawn_independently():
    a, b = lookup_tree(6), lookup_tree(7)
    assert np.mean(np.asarray(a.production) == np.asarray(b.production)) < 0.01
    for random in (a.production.ravel()[:4096], a.production[:, 0], b.permutations):
        assert abs(np.corrcoef(random, a.permutations)[0, 1]) < 5 / 64


def test_the_alphabet_has_4096_letters_by_default():
    explicit, default = (lookup_tree(6, alphabet=n) for n in (4096, None))
    assert np.array_equal(explicit.production, default.production)


def thue_morse(n):
    return np.bitwise_count(np.arange(n)) & 1


def test_art_symbols_are_the_factors_of_the_thue_morse_word():
    word = thue_morse(2**14)
    factors = set(map(tuple, np.lib.stride_tricks.sliding_window_view(word, 21).tolist()))
    assert set(word_factors()) == factors
    assert len(word_factors()) == len(factors) == 64


def letters(production, root, levels):
    """Return the letters of all nodes of a level, as an image."""
    grid = np.array([[root]])
    for _ in range(levels):
        children = production[grid].reshape(*grid.shape, 2, 2)
        grid = children.transpose(0, 2, 1, 3).reshape(2 * len(grid), -1)
    return grid


def test_art_rows_are_successive_factors():
    """At each level the symbols spell the Thue-Morse word, each with the 20 letters before it."""
    factors = np.array(word_factors())
    production = np.asarray(art_production()).astype(int)
    for root in (0, 1, 37):
        grid = letters(production, 65 * root, 6)
        rows, columns = np.divmod(grid, 64)
        assert np.all(rows == rows[:, :1])
        assert np.all(columns == columns[:1])
        spelled = np.concatenate([factors[columns[0, 0], :-1], factors[columns[0], -1]])
        assert np.array_equal(spelled[20:], thue_morse(64) ^ factors[root, -1])
        assert np.array_equal(factors[columns[0]], np.lib.stride_tricks.sliding_window_view(spelled, 21))
        assert np.array_equal(rows[:, 0], columns[0])


def nearest_repetition(grid, reach):
    """Smallest distance, as the larger of both axes, at which a letter comes again; or ``reach``."""
    size, distances = len(grid), [reach]
    for dx in range(min(reach, size)):
        for dy in range(1 - min(reach, size), min(reach, size)):
            low, high = max(dy, 0), size + min(dy, 0)
            if (dx, dy) != (0, 0) and np.any(grid[low:high, dx:] == grid[low - dy : high - dy, : size - dx]):
                distances.append(max(dx, abs(dy)))
    return min(distances)


def test_art_repeats_no_letter_within_its_bound():
    """Equal letters of a level are 24 or more apart along an axis; a random production repeats sooner."""
    order = lookup_tree(2, "art")
    production = np.asarray(order.production).astype(int)
    for level in range(7):
        assert nearest_repetition(letters(production, int(order.root), level), 25) >= 24
    # From any letter: rows and columns are independent, so that one of them will do.
    symbols = np.arange(64)[:, None]
    for _ in range(9):
        symbols = np.stack([production[65 * symbols, half] % 64 for half in range(2)], axis=-1).reshape(
            64, -1
        )
    gaps = [d for d in range(1, 64) if np.any(symbols[:, d:] == symbols[:, :-d])]
    assert gaps == [24, 32, 40, 48, 56]
    random = np.asarray(lookup_tree(2).production).astype(int)
    assert nearest_repetition(letters(random, 0, 6), 25) < 12


def test_bad_codes_are_named():
    with pytest.raises(ValueError, match=r"alphabet must be an integer in \[1, 65536\], got 0"):
        orders.scrambled_morton(4, 4, 1, "tree", 0)
    order = orders.scrambled_morton(4, 4, 1)
    with pytest.raises(ValueError, match=r"code must be integers .* got 64"):
        order.scrambled(64, 3)
