"""Orders: bijections of the padded raster, independent definitions, and how random scrambled ones are."""

from functools import partial
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from refusals import refused
from scipy import stats
from tables import ORDERS, again, each, first, grammar, permutations_of_4

from qmcjax import orders
from qmcjax.core.number_theory import word_factors
from qmcjax.orders._hierarchy import _MATRICES, unpermuted
from qmcjax.orders._scrambled_morton import LookupTree, art_production

pytestmark = pytest.mark.usefixtures("least_optimized")

VARIANTS = {
    "hash": orders.scrambled_morton,
    **{name: partial(orders.scrambled_morton, variant=name) for name in ("multiplicative", "tree", "art")},
}
ONE_LETTER = partial(orders.scrambled_morton, variant="tree", alphabet=1)
each_variant = pytest.mark.parametrize("make", VARIANTS.values(), ids=VARIANTS)
HIERARCHICAL = {
    **{name: getattr(orders, name) for name in ("accordion", "hilbert", "moore", "morton")},
    **{name: partial(make, key=3) for name, make in VARIANTS.items()},
    "optimized": partial(orders.optimized, spp=1, key=3),
}
each_order = each("make", ORDERS | {"scrambled_morton, art": partial(VARIANTS["art"], key=7)})
MAX = orders.MAX_SIDE
GOLDEN_RATIO = (1 + 5**0.5) / 2

COUNT = 3**10
"""Pixels or positions of each call: in one shape, operations compile but once."""


def pixels(order, position=None):
    """Return the pixels at positions, by default at all along the curve, one row each."""
    position = first(order.length) if position is None else np.uint32(position)
    found = np.stack(order.pixel(again(position, COUNT)), axis=1)
    return found[: len(position)].astype(np.int64)


def positions(order, x, y):
    """Return the positions of pixels, in the shape of x."""
    found = order.position(again(np.uint32(x), COUNT), again(np.uint32(y), COUNT))
    return np.asarray(found)[: x.size].reshape(x.shape)


def image(order):
    """Return the positions of all pixels of the raster."""
    columns, rows = order.raster
    y, x = np.indices((rows, columns))
    return positions(order, x, y)


@each_order
@pytest.mark.parametrize("size", [(1, 1), (2, 2), (5, 3), (3, 5), (64, 64), (128, 128)])
def test_bijection(make, size):
    """Every pixel of the padded raster has one position; ``pixel`` and ``position`` invert each other."""
    order = make(*size)
    curve = pixels(order)
    columns, rows = order.raster
    assert columns >= size[0] and rows >= size[1]
    assert order.length == columns * rows == len(np.unique(curve[:, 0] + columns * curve[:, 1]))
    assert np.array_equal(positions(order, *curve.T), first(order.length))


@each_order
def test_bijection_at_the_largest_size(make):
    side = orders.PEANO_SIDE if make is orders.peano else MAX
    order = make(side, side)
    assert order.length == side**2
    rng = np.random.default_rng(0)
    position = rng.integers(0, side**2, COUNT, dtype=np.uint32)
    assert np.array_equal(positions(order, *pixels(order, position).T), position)
    pixel = rng.integers(0, side, (COUNT, 2))
    assert np.array_equal(pixels(order, positions(order, *pixel.T)), pixel)


@jax.jit
def ways(order, column, row):
    row_by_row = jax.vmap(lambda y: order.position(column, y))
    return order.position(column[None, :], row[:, None]), row_by_row(row)


@each_order
def test_any_shape_broadcasts_and_jit_and_vmap_agree(make):
    order, (y, x) = make(20, 12), np.indices((12, 20))
    table = positions(order, x, y)
    for compiled in ways(order, first(20), first(12)):
        assert np.array_equal(compiled, table)


@pytest.mark.parametrize("make", [orders.hilbert, orders.peano])
def test_bad_pixels_and_positions_are_named(make):
    order = make(3, 3)  # padded to 3 or 4 pixels a side
    with pytest.raises(ValueError, match=r"x must be integers in \[0, [23]\], got 4"):
        order.position(4, 0)
    with pytest.raises(ValueError, match=r"y must be integers in \[0, [23]\], got 9"):
        order.position(0, np.array([1, 9], np.uint32))
    with pytest.raises(ValueError, match=r"position must be integers in \[0, (8|15)\], got 16"):
        order.pixel(16)
    assert order.pixel(np.arange(3))[0].dtype == order.position(2, first(3)).dtype == np.uint32


# Definitions


def test_hilbert_equals_its_grammar():
    """Four copies of the smaller curve: transposed, twice as it is, transposed about the other diagonal."""
    curve = np.array([[0, 0]])
    for k in range(6):
        side, (x, y) = 2**k, curve.T
        parts = [(y, x), (x, y + side), (x + side, y + side), (2 * side - 1 - y, side - 1 - x)]
        curve = np.concatenate([np.stack(part, axis=1) for part in parts])
        assert np.array_equal(pixels(orders.hilbert(2 * side, 2 * side)), curve)


def test_morton_interleaves_digits():
    x, y = np.arange(64), np.arange(64)[::-1]
    digits = [zip(f"{v:06b}", f"{u:06b}", strict=True) for u, v in zip(x, y, strict=True)]
    expected = [int("".join(b + a for b, a in pairs), 2) for pairs in digits]
    assert positions(orders.morton(64, 64), x, y).tolist() == expected


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
    assert np.array_equal(image(orders.accordion(2**k, 2**k)), strip.T)


def test_moore_equals_its_l_system():
    """L -> -RF+LFL+FR-, R -> +LF-RFR-FL+ from LFL+F+LFL: a turtle, told nothing of Hilbert curves."""
    rules, word = {"L": "-RF+LFL+FR-", "R": "+LF-RFR-FL+"}, "LFL+F+LFL"
    for k in range(1, 5):
        place, heading = 2 ** (k - 1) - 1 + (2**k - 1) * 1j, -1j
        path = [place]
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


CONTINUOUS = [
    *((orders.hilbert, side, lambda n: (n - 1, 0)) for side in (2, 4, 8, 16, 128, MAX)),
    *((orders.moore, side, lambda n: (1, 0)) for side in (2, 128, MAX)),
    *((orders.peano, side, lambda n: (n - 1, n - 1)) for side in (3, 81, orders.PEANO_SIDE)),
]


@pytest.mark.parametrize(("make", "side", "end"), CONTINUOUS)
def test_steps_go_to_neighbours(make, side, end):
    """From one corner to another; around and back to the pixel beside the first on Moore's curve."""
    order, last = make(side, side), side**2 - 1
    assert (order.raster, order.length) == ((side, side), side**2)
    start = np.random.default_rng(1).integers(0, last, 20000) if side > 1000 else np.arange(last)
    start = np.append(start, [0, last - 1])
    here, there = pixels(order, start), pixels(order, start + 1)
    assert np.all(np.abs(here - there).sum(axis=1) == 1)
    assert (there[-1] - here[-2]).tolist() == list(end(side))


@pytest.mark.parametrize("make", HIERARCHICAL.values(), ids=HIERARCHICAL)
def test_aligned_blocks_hold_aligned_runs(make):
    """The quadtree property on all levels: in whole for 64 x 64 pixels, sampled for 65536 x 65536."""
    table = image(make(64, 64))
    assert np.array_equal(np.unique(table), np.arange(64**2))
    for k in range(7):
        blocks = (table >> np.uint32(2 * k)).reshape(64 >> k, 2**k, 64 >> k, 2**k)
        assert np.all(blocks == blocks[:, :1, :, :1])
    rng, order = np.random.default_rng(2), make(MAX, MAX)
    k = rng.integers(0, 17, 10**4)
    pixel = rng.integers(0, 2**16, (2, 10**4))
    neighbour = pixel ^ rng.integers(0, 2**k, (2, 10**4))
    here, there = (positions(order, *where).astype(np.int64) for where in (pixel, neighbour))
    assert np.all((here ^ there) >> (2 * k) == 0)


# Orders of users


class Columns:
    """Column by column: an order of a user, without decorator, base class or inverse."""

    width, height, length = 5, 3, 15

    def position(self, x, y):
        return x * np.uint32(3) + y


def test_any_object_with_the_protocol_is_an_order():
    order = orders.as_order("order", Columns())
    y, x = np.indices((3, 5), np.uint32)
    assert np.array_equal(jax.jit(lambda o: o.position(x, y))(order), np.arange(15).reshape(5, 3).T)
    assert (order.raster, order.length) == ((5, 3), 15)
    assert orders.as_order("order", order) is order
    with pytest.raises(TypeError, match=r"order must have a method pixel\(position\), got .*Columns"):
        order.pixel(0)


WANTED = r"order must have position return integers of shape \(3,\), got "


@pytest.mark.parametrize(
    ("position", "message"),
    [
        (lambda x, y: x.astype(np.float32), WANTED + r"float32 \(3,\)"),
        (lambda x, y: x[:1], WANTED + r"uint32 \(1,\)"),
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
    given = np.random.default_rng(3).permutation(35).reshape(5, 7)
    order = orders.permutation(given)
    assert (order.width, order.height, order.length) == (7, 5, 35)
    assert np.array_equal(image(order), given)
    assert np.array_equal(pixels(order, given.ravel()), np.indices((5, 7))[::-1].reshape(2, -1).T)
    # What a curve does with a table of its positions, it does without.
    hilbert = orders.hilbert(8, 8)
    assert np.array_equal(pixels(orders.permutation(image(hilbert))), pixels(hilbert))


# Scrambled Morton orders


def test_numbers_are_all_permutations_and_invertible():
    assert len(_MATRICES) == 6
    numbers = permutations_of_4()
    assert sorted(map(tuple, numbers)) == list(permutations(range(4)))
    number, digit = np.broadcast_arrays(first(24)[:, None], first(4))
    assert np.array_equal(unpermuted(jnp.asarray(number), jnp.asarray(np.uint32(numbers))), digit)


@pytest.mark.parametrize("make", [*VARIANTS.values(), ONE_LETTER], ids=[*VARIANTS, "one letter"])
def test_scrambled_morton_equals_its_recursion(make):
    """Draw the quadrants in the permuted order, each as a scrambled square of its own: Eq. 5."""
    order = make(16, 16, key=11)
    root, permutation, child = grammar(order)

    def curve(node, x, y, side):
        if side == 1:
            return [(x, y)]
        place, drawn, half = permutation(node), [], side // 2
        for digit in sorted(range(4), key=place.__getitem__):
            drawn += curve(child(node, digit), x + half * (digit & 1), y + half * (digit >> 1), half)
        return drawn

    expected = np.array(curve(root, 0, 0, 16))
    assert np.array_equal(pixels(order), expected)
    assert np.array_equal(positions(order, *expected.T), first(256))


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hash", "tree", "art"])
def test_neighbouring_nodes_are_independent(drawn, name):
    """Siblings, vertically too, cousins, parents and children, and one place for two keys; no node twice."""
    parents, last = drawn[name][2:]
    children = last.reshape(KEYS, 4, 4, 4)
    for a, b in (
        (children[..., 0], children[..., 1]),
        (children[..., 1], children[..., 3]),
        (children[:, :, 0, 1], children[:, :, 1, 0]),
        (parents, last[:, ::4]),
        (last[::2], last[1::2]),
    ):
        assert is_uniform(np.bincount((24 * a + b).ravel(), minlength=576))


@pytest.mark.slow
def test_neighbouring_nodes_of_the_multiplicative_hash_are_not():
    """Siblings are one step of the golden ratio apart: 14 or 15 of 24, and never the same."""
    for d in range(4):
        node = first(4**6)[::2]
        order = orders.scrambled_morton(4, 4, key=d, variant="multiplicative")
        found = [np.asarray(order._permutation(jnp.asarray(n))) for n in (node, node + np.uint32(1))]
        a, b = (each.astype(int) for each in found)
        assert np.unique((b - a) % 24).tolist() == ([9, 10] if d % 2 else [14, 15])


# Productions


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


def windows(word):
    """Return each letter from the 21st on with the 20 before it."""
    return np.lib.stride_tricks.sliding_window_view(word, 21)


def test_art_symbols_are_the_factors_of_the_thue_morse_word():
    factors = set(map(tuple, windows(thue_morse(2**14)).tolist()))
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
        rows, columns = np.divmod(letters(production, 65 * root, 6), 64)
        assert np.all(rows == rows[:, :1])
        assert np.all(columns == columns[:1])
        spelled = np.concatenate([factors[columns[0, 0], :-1], factors[columns[0], -1]])
        assert np.array_equal(spelled[20:], thue_morse(64) ^ factors[root, -1])
        assert np.array_equal(factors[columns[0]], windows(spelled))
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
        halves = [production[65 * symbols, half] % 64 for half in range(2)]
        symbols = np.stack(halves, axis=-1).reshape(64, -1)
    gaps = [d for d in range(1, 64) if np.any(symbols[:, d:] == symbols[:, :-d])]
    assert gaps == [24, 32, 40, 48, 56]
    random = np.asarray(lookup_tree(2).production).astype(int)
    assert nearest_repetition(letters(random, 0, 6), 25) < 12


MORTON3 = partial(orders.morton3, key=7)
FAMILIES = {"morton3": orders.morton3, "morton3, scrambled": MORTON3, "hilbert3": orders.hilbert3}
SIZES = [(1, 1, 1), (8, 5, 2), (3, 2, 9), (4, 4, 4), (1, 1, 8), (6, 7, 1), (16, 3, 4)]


PLACES = 2**10
"""Positions or pixels of each call: in one shape, operations compile but once."""


def pixels_in_time(order):
    """Return x, y and t of all positions."""
    found = order.pixel(again(first(order.length), PLACES))
    return np.stack(found)[:, : order.length].astype(np.int64)


def places_in_time(order, *pixel):
    """Return the positions of pixels, in the shape of the first coordinate."""
    found = order.position(*(again(np.uint32(v), PLACES) for v in pixel))
    return np.asarray(found)[: pixel[0].size].reshape(pixel[0].shape)


@pytest.mark.parametrize("make", FAMILIES.values(), ids=FAMILIES)
@pytest.mark.parametrize("size", SIZES)
def test_orders_of_pixels_and_frames_are_bijections(make, size):
    order = make(*size)
    side, frames = 2**order.log_side, 2**order.log_frames
    assert side >= max(size[:2]) > side // 2 and frames >= size[2] > frames // 2
    x, y, t = pixels_in_time(order)
    assert order.length == side**2 * frames
    assert len(set(zip(x.tolist(), y.tolist(), t.tolist(), strict=True))) == order.length
    assert max(x.max(), y.max()) == side - 1 and t.max() == frames - 1
    np.testing.assert_array_equal(places_in_time(order, x, y, t), first(order.length))


@pytest.mark.parametrize("size", SIZES)
def test_consecutive_positions_of_the_hilbert_order_are_neighbours(size):
    assert (np.abs(np.diff(pixels_in_time(orders.hilbert3(*size)))).sum(axis=0) == 1).all()


def test_hilbert_of_one_frame_is_a_curve_in_the_plane():
    x, y, t = pixels_in_time(orders.hilbert3(16, 16, 1))
    assert not t.any()
    plane = np.stack(orders.hilbert(16, 16).pixel(again(first(256), PLACES)))
    np.testing.assert_array_equal(np.stack([x, y]), plane[:, :256])


@pytest.mark.parametrize("make", FAMILIES.values(), ids=FAMILIES)
@pytest.mark.parametrize("size", [(8, 8, 8), (8, 8, 2), (2, 2, 16)])
def test_cubes_have_contiguous_aligned_runs(make, size):
    order = make(*size)
    x, y, t = pixels_in_time(order)
    levels = min(order.log_side, order.log_frames)
    for k in range(levels + 1):
        runs = (x >> k << 40 | y >> k << 20 | t >> k).reshape(-1, 8**k)
        assert (runs == runs[:, :1]).all()
        if "Morton3" in type(order).__name__ and k < order.log_frames:
            # Halves of the frames are the last digits: the same pixels in twice as many frames.
            runs = (x >> k << 40 | y >> k << 20 | t >> (k + 1)).reshape(-1, 2 * 8**k)
            assert (runs == runs[:, :1]).all()


@pytest.mark.slow
def test_permutations_of_blocks_are_uniform_over_keys():
    """Quadrants of the first node, and halves below the first quadrant: frequencies within 5 sigma."""
    keys = 2400

    def order(seed):
        made = orders.morton3(4, 4, 4, jax.random.wrap_key_data(jnp.stack([seed, seed ^ 5])))
        x, t = jnp.array([0, 2, 0, 2, 0], jnp.uint32), jnp.array([0, 0, 0, 0, 2], jnp.uint32)
        y = jnp.array([0, 0, 2, 2, 0], jnp.uint32)
        return made.unchecked_position(x, y, t)

    places_in_time = np.asarray(jax.vmap(order)(first(keys)))
    quadrants = places_in_time[:, :4] >> 4
    numbers = np.unique(quadrants @ [64, 16, 4, 1], return_inverse=True)[1]
    counts = np.bincount(numbers)
    assert len(counts) == 24
    assert np.abs(counts - keys / 24).max() < 5 * np.sqrt(keys / 24 * 23 / 24)
    # The half of the first frame in its quadrant: a coin that depends on nothing above.
    half = (places_in_time[:, 0] >> 3) & 1
    assert (half != (places_in_time[:, 4] >> 3) & 1).all()
    assert abs(half.mean() - 0.5) < 5 * 0.5 / np.sqrt(keys)
    agreement = (half == (quadrants[:, 0] & 1)).mean()
    assert abs(agreement - 0.5) < 5 * 0.5 / np.sqrt(keys)


@pytest.mark.parametrize("make", FAMILIES.values(), ids=FAMILIES)
def test_one_frame_is_an_order_of_pixels_that_is_traced_once(make):
    order, traces = make(5, 7, 6), []
    y, x = np.indices((7, 5))

    @jax.jit
    def traced(frame):
        traces.append(frame)
        return order.at_frame(frame).position(first(5)[None, :], first(7)[:, None])

    for frame in (0, 5, 7):
        expected = places_in_time(order, x, y, np.full_like(x, frame))
        np.testing.assert_array_equal(traced(frame), expected)
        one = order.at_frame(frame)
        np.testing.assert_array_equal(places_in_time(one, x, y), expected)
        first_frame = places_in_time(order, x, y, 0 * x)
        np.testing.assert_array_equal(places_in_time(one.at_frame(0), x, y), first_frame)
        found = one.pixel(again(expected, PLACES))
        np.testing.assert_array_equal(np.stack(found)[:, :35], np.stack([x.ravel(), y.ravel()]))
    assert len(traces) == 1


def test_large_orders_have_positions_of_32_bits():
    for make in FAMILIES.values():
        order = make(1920, 1080, 1024)
        assert order.length == 2**32
        given = np.random.default_rng(1).integers(0, [[2048], [2048], [1024]], (3, PLACES), np.uint32)
        given[:, :3] = [[0, 1919, 2047], [5, 1079, 2047], [3, 1000, 1023]]
        position = order.position(*(again(v, PLACES) for v in given))
        np.testing.assert_array_equal(np.stack(order.pixel(position)), given)


test_wrong_sizes_and_frames_are_refused = refused(
    (lambda: orders.morton3(1920, 1080, 1025), r"frames must be .* in \[1, 1024\], got 1025"),
    (
        lambda: orders.as_order("order", orders.morton3(4, 4, 2)),
        TypeError,
        r"order must be an order of pixels, as .at_frame\(t\) returns, got Morton3",
    ),
    (lambda: orders.hilbert3(4, 4, 5).at_frame(8), r"frame must be .* in \[0, 7\], got 8"),
    (lambda: orders.morton3(4, 4, 5).at_frame(np.arange(2)), r"one integer, got shape \(2,\)"),
    error=ValueError,
)
