"""Trees of boxes, against enumeration, recursion, and lines that are spread evenly."""

from itertools import combinations

import numpy as np
import pytest

from qmcjax.tracing import trees


def boxes(count, key, dims=3, size=0.3):
    rng = np.random.default_rng(key)
    low = rng.uniform(-1, 1, (count, dims))
    return low, low + size * rng.uniform(size=(count, dims)) ** 3


def grid():
    """Return boxes of which many are the same, flat, or points."""
    low = np.stack(np.meshgrid(np.arange(4.0), np.arange(3), [0]), -1).reshape(-1, 3)
    high = low + np.array([1, 1, 0])
    return np.concatenate([low, low, low]), np.concatenate([high, low, high])


SETS = {
    "one": boxes(1, 0),
    "two": boxes(2, 1),
    "some": boxes(97, 2),
    "grid": grid(),
    "one place": (np.zeros((70, 3)), np.ones((70, 3))),
    "growing": (np.zeros((90, 3)), np.ones((90, 3)) * 1.4 ** np.arange(90)[:, None]),
    "in time": boxes(80, 3, dims=4),
}


def area(low, high):
    x, y, z = high[:3] - low[:3]
    return 2 * (x * y + y * z + z * x) * (high[3] - low[3] if len(low) > 3 else 1)


def around(low, high, members):
    return low[members].min(axis=0), high[members].max(axis=0)


def members(tree):
    """Return the leaves below each node."""
    found = [[k] for k in range(tree.size)]
    for one, other in tree.children:
        found.append(found[one] + found[other])
    return found


def check(tree, low, high):
    """Each leaf once, children before parents, boxes that just hold what is below, depths one by one."""
    found, root = members(tree), 2 * tree.size - 2
    assert tree.size == len(low) and sorted(found[root]) == list(range(len(low)))
    assert sorted(tree.children.reshape(-1)) == list(range(root))
    assert all(tree.children[k].max() < tree.size + k for k in range(tree.size - 1))
    expected = [around(low, high, of) for of in found]
    assert np.array_equal(tree.low, [box[0] for box in expected])
    assert np.array_equal(tree.high, [box[1] for box in expected])
    depth = np.zeros(root + 1, int)
    for node in reversed(range(tree.size, root + 1)):
        depth[tree.children[node - tree.size]] = depth[node] + 1
    assert np.array_equal(trees.node_depths(tree), depth)
    assert np.isclose(trees.summed_area(tree), sum(area(*box) for box in expected), rtol=1e-12)


BUILDERS = {"surface area": trees.surface_area_tree}


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
@pytest.mark.parametrize("name", SETS)
def test_structure(name, builder):
    check(builder(*SETS[name]), *SETS[name])


def least_cost(low, high, of):
    """Return the cost of the best split of some boxes (Eq. 4.1), and how uneven the evenest of these is."""
    found = []
    for axis in range(low.shape[1]):
        order = sorted(of, key=lambda k: low[k, axis] + high[k, axis])
        for j in range(1, len(of)):
            cost = sum(len(part) * area(*around(low, high, part)) for part in (order[:j], order[j:]))
            found.append((cost, abs(2 * j - len(of))))
    least = min(cost for cost, _ in found)
    return least, min(uneven for cost, uneven in found if cost <= least * (1 + 1e-9))


@pytest.mark.parametrize("name", ["some", "one place", "growing", "in time"])
def test_splits_are_the_best_of_a_sweep(name):
    low, high = SETS[name]
    tree = trees.surface_area_tree(low, high)
    found = members(tree)
    for node, (one, other) in enumerate(tree.children, start=tree.size):
        sizes = [len(found[k]) for k in (one, other)]
        cost = sum(
            size * area(tree.low[k], tree.high[k]) for size, k in zip(sizes, (one, other), strict=True)
        )
        least, uneven = least_cost(low, high, found[node])
        assert np.isclose(cost, least, rtol=1e-9) and abs(sizes[0] - sizes[1]) == uneven


def test_equal_boxes_are_halved():
    """Not taken away one by one, which costs as much by Eq. 4.1."""
    assert trees.node_depths(trees.surface_area_tree(*SETS["one place"])).max() == 7


def all_trees(of):
    """Yield all binary trees over a set as the sets of their inner nodes, each tree once."""
    if len(of) == 1:
        yield ()
        return
    first, rest = of[0], of[1:]
    for size in range(len(rest)):
        for some in combinations(rest, size):
            one, other = (first, *some), tuple(k for k in rest if k not in some)
            for left in all_trees(one):
                for right in all_trees(other):
                    yield (of, *left, *right)


def test_there_are_as_many_trees_as_eq_4_4_says():
    """Times the two orders of the children of each of m - 1 nodes."""
    for m, ordered in enumerate((1, 2, 12, 120, 1680, 30240, 665280), start=1):
        found = list(all_trees(tuple(range(m))))
        assert len(set(map(frozenset, found))) == len(found) and len(found) * 2 ** (m - 1) == ordered


def least_sum(low, high):
    """Return the least sum of areas of all trees, by looking at each of them."""
    areas = {}
    count = len(low)
    for size in range(1, count + 1):
        for of in combinations(range(count), size):
            areas[of] = area(*around(low, high, list(of)))
    leaves = sum(areas[(k,)] for k in range(count))
    return leaves + min(sum(areas[of] for of in tree) for tree in all_trees(tuple(range(count))))


@pytest.mark.parametrize(
    ("count", "sets", "dims"),
    [(3, 30, 3), (4, 30, 4), (5, 20, 3), (6, 5, 3), pytest.param(7, 30, 3, marks=pytest.mark.slow)],
)
def test_small_trees_are_optimal(count, sets, dims):
    """One subtree is the whole tree: whatever it was before, it is the best of all trees."""
    for key in range(sets):
        low, high = boxes(count, key, dims, size=[0.01, 1.0, 3.0][key % 3])
        tree = trees.optimal_subtrees(trees.surface_area_tree(low, high))
        check(tree, low, high)
        assert np.isclose(trees.summed_area(tree), least_sum(low, high), rtol=1e-12)


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize(("leaves", "levels"), [(8, None), (3, None), (5, 2)])
def test_subtrees_never_grow(name, leaves, levels):
    before = trees.surface_area_tree(*SETS[name])
    for _ in range(3):
        after = trees.optimal_subtrees(before, leaves, levels)
        check(after, *SETS[name])
        assert trees.summed_area(after) <= trees.summed_area(before)
        before = after
    if name == "some" and leaves == 8:
        assert trees.summed_area(after) < 0.995 * trees.summed_area(trees.surface_area_tree(*SETS[name]))


def test_repeated_runs_end_where_all_subtrees_are_optimal():
    """Sect. 4.1.2's conjecture, with the trees over up to 5 nodes below each that are opened by levels."""
    low, high = boxes(60, 5)
    tree = trees.surface_area_tree(low, high)
    for _ in range(20):
        before, tree = trees.summed_area(tree), trees.optimal_subtrees(tree, 5)
    assert trees.summed_area(tree) == before
    for root in range(tree.size, 2 * tree.size - 1):
        ends, inner = [root], []
        while len(ends) < 5 and any(node >= tree.size for node in ends):
            node = min((n for n in ends if n >= tree.size), key=lambda n: inner_depth(tree, root, n))
            inner.append(node)
            ends = [n for n in ends if n != node] + list(tree.children[node - tree.size])
        sums = sum(area(tree.low[n], tree.high[n]) for n in inner + ends)
        # Of nodes that are as deep, either may be opened first: only what is below a full level is sure.
        if len({inner_depth(tree, root, n) for n in ends}) == 1:
            assert sums <= least_sum(tree.low[ends], tree.high[ends]) * (1 + 1e-9)


def inner_depth(tree, root, node):
    depth = trees.node_depths(tree)
    return depth[node] - depth[root]


def test_only_upper_levels_change():
    """Below the subtrees of the uppermost levels nodes stay, with all that is below them."""
    low, high = boxes(2000, 7)
    before = trees.surface_area_tree(low, high)
    after = trees.optimal_subtrees(before, 8, levels=2)
    kept = {frozenset(of) for of in members(before)} & {frozenset(of) for of in members(after)}
    # The root, the two below it, and what is on three more levels.
    assert len(kept) >= 2 * len(low) - 1 - (2**5 - 1) and trees.summed_area(after) < trees.summed_area(before)


def lines(count, key):
    """Return lines that are spread evenly through the ball of radius 2, as rays from outside of it."""
    rng = np.random.default_rng(key)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    side = np.cross(direction, np.roll(direction, 1, axis=1) + np.array([0.1, 0.2, 0.3]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle, radius = rng.uniform(0, 2 * np.pi, count), 2.0 * np.sqrt(rng.uniform(size=count))
    disc = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(direction, side)
    return radius[:, None] * disc - 4 * direction, direction


@pytest.mark.parametrize("way", ["still", "in time", "moving"])
def test_lines_meet_nodes_in_proportion_to_areas(way):
    """Mean numbers of visited nodes are the summed area over that of the disc's lines, within 5 sigma."""
    low, high = boxes(60, 4, dims=4 if way == "in time" else 3)
    tree, time, rest = trees.surface_area_tree(low, high), None, 1.0
    origin, direction = lines(40000, 8)
    if way == "moving":
        ends = [low, low * 0.5 - 0.2, low[::-1]]
        tree = trees.refitted(tree, ends, [end + high - low for end in ends], [0.0, 0.3, 1.0])
    if way != "still":
        time = np.random.default_rng(2).uniform(-1.0 if way == "in time" else 0.0, 1.5, len(origin))
        time, rest = (time, 2.5) if way == "in time" else (time / 1.5, 1.0)
    found = trees.nodes_visited(tree, origin, direction, time=time)
    # A ball of radius 2 has the area 16 pi.
    expected = trees.summed_area(tree) / (16 * np.pi * rest)
    assert abs(found.mean() - expected) < 5 * found.std() / np.sqrt(len(found))


def visits(tree, origin, direction, vertices):
    """Go through a tree with a recursion: the number of visited nodes and the distance of the hit."""

    def entry(node):
        with np.errstate(divide="ignore"):
            one, other = ((a[node] - origin) / direction for a in (tree.low, tree.high))
        near, far = max(np.minimum(one, other).max(), 0), np.maximum(one, other).min()
        return near if near <= far else np.inf

    def go(node, limit):
        if node < tree.size:
            a, b, c = vertices[node]
            try:
                distance, u, v = np.linalg.solve(np.stack([-direction, b - a, c - a], 1), origin - a)
            except np.linalg.LinAlgError:
                return 1, limit
            return 1, min(limit, distance) if min(u, v, distance, 1 - u - v) > 0 else limit
        count = 1
        for child in sorted(tree.children[node - tree.size], key=entry):
            if entry(child) < limit:
                more, limit = go(child, limit)
                count += more
        return count, limit

    return go(2 * tree.size - 2, np.inf) if entry(2 * tree.size - 2) < np.inf else (0, np.inf)


def soup(count, key, size=0.4):
    rng = np.random.default_rng(key)
    return rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))


def test_traversal_is_that_of_a_recursion():
    """With hits, from inside and outside; without rays; the order of rays does not matter."""
    vertices = soup(40, 1)
    tree = trees.optimal_subtrees(trees.surface_area_tree(vertices.min(axis=1), vertices.max(axis=1)))
    rng = np.random.default_rng(3)
    origin, direction = rng.normal(size=(150, 3)), rng.normal(size=(150, 3))
    distance = trees.triangle_distances(vertices, origin, direction)
    found = trees.nodes_visited(tree, origin, direction, distance)
    expected = [visits(tree, o, d, vertices)[0] for o, d in zip(origin, direction, strict=True)]
    assert np.array_equal(found, expected) and found.dtype == np.int64
    assert np.any(found < trees.nodes_visited(tree, origin, direction))
    assert trees.nodes_visited(tree, np.zeros((0, 3)), [0, 0, 1]).shape == (0,)
    square = trees.nodes_visited(tree, origin.reshape(10, 15, 3), direction.reshape(10, 15, 3), distance)
    assert np.array_equal(square.reshape(-1), found)


def test_moving_triangles_are_hit_where_they_are():
    """As still ones, taken half-way, are; numbers tell which triangle is in which leaf."""
    ends = np.stack([soup(20, 2, 1.5), soup(20, 5, 1.5)])
    rng = np.random.default_rng(4)
    rays = rng.normal(size=(500, 3)), rng.normal(size=(500, 3))
    middle = ends.mean(axis=0)
    pairs = np.repeat(np.arange(500), 20), np.tile(np.arange(20), 500)
    still = trees.triangle_distances(middle[::-1], *rays, number=np.arange(20)[::-1])(*pairs)
    moving = trees.triangle_distances(ends, *rays, times=[1.0, 3.0], time=2.0)(*pairs)
    assert np.allclose(still, moving, rtol=1e-9) and 0.01 < np.mean(np.isfinite(still)) < 0.5


def test_rays_along_flat_boxes_touch_them():
    tree = trees.surface_area_tree([[0, 0, 0], [0, 0, 1]], [[1, 1, 0], [1, 1, 1]])
    assert trees.nodes_visited(tree, [[-1, 0.5, 0], [-1, 0, 1], [0.5, 0.5, 5]], [1, 0, 0]).tolist() == [
        2,
        2,
        0,
    ]
    assert trees.nodes_visited(tree, [[0.5, 0.5, -1], [0.5, 0.5, 0.5]], [0.0, 0, -2.0]).tolist() == [0, 2]


FINE = boxes(4, 0)
TREE = trees.surface_area_tree(*FINE)
UP = ([0.0, 0, 0], [0.0, 0, 1])
WRONG = {
    "low": (lambda: trees.surface_area_tree("a", FINE[1]), TypeError, "low must be made of real numbers"),
    "dims": (
        lambda: trees.surface_area_tree([[0, 0]], [[1, 1]]),
        ValueError,
        r"low must have shape \(n, 3\)",
    ),
    "shapes": (
        lambda: trees.surface_area_tree(FINE[0], FINE[1][:2]),
        ValueError,
        "high must have the shape of",
    ),
    "none": (
        lambda: trees.surface_area_tree(np.zeros((0, 3)), np.zeros((0, 3))),
        ValueError,
        "low must have",
    ),
    "order": (
        lambda: trees.surface_area_tree(FINE[1], FINE[0]),
        ValueError,
        "high must be at least low, got",
    ),
    "nan": (lambda: trees.surface_area_tree([[0, 0, np.nan]], [[1, 1, 1]]), ValueError, "low must be finite"),
    "huge": (
        lambda: trees.surface_area_tree([[0, 0, 0]], [[1e99, 1, 1]]),
        ValueError,
        "high must be finite, and",
    ),
    "area": (lambda: trees.surface_area([0, 0], [1, 1]), ValueError, r"low must have shape \(..., 3\)"),
    "tree": (lambda: trees.summed_area(FINE), TypeError, "tree must be a Tree, got"),
    "leaves": (lambda: trees.optimal_subtrees(TREE, 9), ValueError, r"leaves must be an integer in \[3, 8\]"),
    "levels": (lambda: trees.optimal_subtrees(TREE, levels=0), ValueError, "levels must be an integer in"),
    "optimal": (lambda: trees.optimal_subtrees(3), TypeError, "tree must be a Tree, got 3"),
    "refitted": (lambda: trees.refitted(TREE, FINE[0][:2], FINE[1][:2]), ValueError, "low must have 4 boxes"),
    "moving": (
        lambda: trees.refitted(TREE, *FINE, times=[0, 1]),
        ValueError,
        r"low must have shape \(k, n, 3\)",
    ),
    "times": (
        lambda: trees.refitted(TREE, [FINE[0]] * 2, [FINE[1]] * 2, times=[1, 0]),
        ValueError,
        "times must be finite and increasing",
    ),
    "origin": (
        lambda: trees.nodes_visited(TREE, [0, 0], UP[1]),
        ValueError,
        r"origin must have shape \(..., 3\)",
    ),
    "direction": (lambda: trees.nodes_visited(TREE, *UP[:1] * 2), ValueError, "direction must have a length"),
    "rays": (
        lambda: trees.nodes_visited(TREE, np.ones((2, 3)), np.ones((4, 3))),
        ValueError,
        "direction must",
    ),
    "distance": (
        lambda: trees.nodes_visited(TREE, *UP, 1.0),
        TypeError,
        "distance must be callable, got 1.0",
    ),
    "returned": (
        lambda: trees.nodes_visited(
            TREE, TREE.low[:1] - [0, 0, 1], UP[1], lambda rays, leaves: np.ones(1000)
        ),
        ValueError,
        r"distance must return distances of shape \(1,\), got \(1000,\)",
    ),
    "time": (
        lambda: trees.nodes_visited(trees.surface_area_tree(*SETS["in time"]), *UP),
        TypeError,
        "time must be given",
    ),
    "vertices": (
        lambda: trees.triangle_distances(FINE[0], *UP),
        ValueError,
        r"vertices must have shape \(n, 3",
    ),
    "number": (
        lambda: trees.triangle_distances(soup(2, 0), *UP, number=[2]),
        ValueError,
        r"number must be in \[0, 1\], got \[2\]",
    ),
}


@pytest.mark.parametrize(("call", "kind", "message"), WRONG.values(), ids=WRONG)
def test_mistakes_are_named(call, kind, message):
    with pytest.raises(kind, match=message):
        call()
