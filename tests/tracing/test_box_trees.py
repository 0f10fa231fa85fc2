"""Trees of boxes, against enumeration, recursion, and lines that are spread evenly."""

from functools import partial
from itertools import combinations, pairwise, product

import numpy as np
import pytest
from oracles import of_triangle
from refusals import refused

from analysis import trees
from analysis.trees import _clusters


def boxes(count, key, dims=3, size=0.3):
    rng = np.random.default_rng(key)
    low = rng.uniform(-1, 1, (count, dims))
    return low, low + size * rng.uniform(size=(count, dims)) ** 3


def grid():
    """Return boxes of which many are the same, flat, or points."""
    low = np.stack(np.meshgrid(np.arange(4.0), np.arange(3), [0]), -1).reshape(-1, 3)
    high = low + np.array([1, 1, 0])
    return np.concatenate([low, low, low]), np.concatenate([high, low, high])


SETS = {"one": boxes(1, 0), "two": boxes(2, 1), "some": boxes(97, 2), "grid": grid()}
SETS |= {"one place": (np.zeros((70, 3)), np.ones((70, 3))), "in time": boxes(80, 3, dims=4)}
SETS["growing"] = np.zeros((90, 3)), np.ones((90, 3)) * 1.4 ** np.arange(90)[:, None]


def area(low, high):
    x, y, z = high[:3] - low[:3]
    return 2 * (x * y + y * z + z * x) * (high[3] - low[3] if len(low) > 3 else 1)


def around(low, high, members):
    return low[members].min(axis=0), high[members].max(axis=0)


def members(tree):
    """Return the leaves below each node, the root last, as they come if first children come first."""
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


BUILDERS = {
    "surface area": trees.surface_area_tree,
    "Hilbert": trees.hilbert_tree,
    "Morton": trees.morton_tree,
    "two means": trees.two_means_tree,
    "quadratic": trees.quadratic_split_tree,
    "quadratic, filled": partial(trees.quadratic_split_tree, fill=0.4),
}


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
@pytest.mark.parametrize("name", SETS)
def test_structure(name, builder):
    check(builder(*SETS[name]), *SETS[name])


def edges_area(extent):
    return 2 * (extent * np.roll(extent, 1, axis=-1)).sum(axis=-1)


COSTS = {
    "Eq. 4.1": lambda n, extent: n * edges_area(extent),
    "Eq. 4.2": lambda n, extent: (2 * n - 1) * edges_area(extent),
    "volume": lambda n, extent: n * extent.prod(axis=-1),
}


def least_cost(low, high, of, cost_of):
    """Return the cost of the best split of some boxes, and how uneven the evenest of these is."""
    found = []
    for axis in range(low.shape[1]):
        order = sorted(of, key=lambda k: low[k, axis] + high[k, axis])
        for j in range(1, len(of)):
            cost = sum(cost_of(len(part), *around(low, high, part)) for part in (order[:j], order[j:]))
            found.append((cost, abs(2 * j - len(of))))
    least = min(cost for cost, _ in found)
    return least, min(uneven for cost, uneven in found if cost <= least * (1 + 1e-9))


SPLITS = [(name, None) for name in ("some", "one place", "growing", "in time")]
SPLITS += [("thirty", name) for name in COSTS]


@pytest.mark.parametrize(("name", "formula"), SPLITS)
def test_splits_are_the_best_of_a_sweep(name, formula):
    low, high = boxes(30, 7) if name == "thirty" else SETS[name]
    tree = trees.surface_area_tree(low, high, cost=COSTS.get(formula))

    def cost_of(n, low, high):
        return n * area(low, high) if formula is None else COSTS[formula](n, high - low)

    found = members(tree)
    for node, (one, other) in enumerate(tree.children, start=tree.size):
        sizes = [len(found[k]) for k in (one, other)]
        cost = sum(cost_of(n, tree.low[k], tree.high[k]) for n, k in zip(sizes, (one, other), strict=True))
        least, uneven = least_cost(low, high, found[node], cost_of)
        assert np.isclose(cost, least, rtol=1e-9) and abs(sizes[0] - sizes[1]) == uneven


def test_eq_4_2_is_not_least_where_eq_4_1_is():
    """Sect. 4.1.1 says that it is, for exactly the same split; the areas of both children differ by split."""
    costs = None, COSTS["Eq. 4.1"], COSTS["Eq. 4.2"]
    default, one, other = (trees.surface_area_tree(*SETS["some"], cost=cost).children for cost in costs)
    assert np.array_equal(default, one) and not np.array_equal(one, other)


@pytest.mark.parametrize("name", ["some", "one place", "growing", "grid"])
@pytest.mark.parametrize("builder", [trees.surface_area_tree, trees.two_means_tree, trees.morton_tree])
def test_eq_4_2_bounds_the_summed_area_below_each_node(name, builder):
    """Sect. 4.1.1: of any tree. It is attained where all boxes are equal, and far from it elsewhere."""
    tree = builder(*SETS[name])
    areas = trees.surface_area(tree.low, tree.high)
    count, below = np.ones_like(areas), areas.copy()
    for node, (one, other) in enumerate(tree.children, start=tree.size):
        count[node] = count[one] + count[other]
        below[node] += below[one] + below[other]
        bound = areas[node] + sum((2 * count[k] - 1) * areas[k] for k in (one, other))
        assert below[node] <= bound * (1 + 1e-12)
    assert (below[-1] > 0.999 * bound) == (name == "one place")


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


def test_repeated_runs_end_where_all_subtrees_are_optimal():
    """Sect. 4.1.2's conjecture, with the trees over up to 5 nodes below each that are opened by levels."""
    low, high = boxes(60, 5)
    tree = trees.surface_area_tree(low, high)
    for _ in range(20):
        before, tree = trees.summed_area(tree), trees.optimal_subtrees(tree, 5)
    assert trees.summed_area(tree) == before
    depth = trees.node_depths(tree)
    for root in range(tree.size, 2 * tree.size - 1):
        ends, inner = [root], []
        while len(ends) < 5 and any(node >= tree.size for node in ends):
            node = min((n for n in ends if n >= tree.size), key=depth.__getitem__)
            inner.append(node)
            ends = [n for n in ends if n != node] + list(tree.children[node - tree.size])
        sums = sum(area(tree.low[n], tree.high[n]) for n in inner + ends)
        # Of nodes that are as deep, either may be opened first: only what is below a full level is sure.
        if len({depth[n] for n in ends}) == 1:
            assert sums <= least_sum(tree.low[ends], tree.high[ends]) * (1 + 1e-9)


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


def visits(tree, origin, direction, vertices, nearest_first=True):
    """Go through a tree with a recursion: the visited nodes and the distance of the hit."""

    def along(pair):
        """Return the children as they come along the axis on which they are farthest apart."""
        center = tree.low[pair] + tree.high[pair]
        axis = np.argmax(abs(center[1] - center[0]))
        return sorted(pair, key=lambda k: np.sign(direction[axis]) * (tree.low[k] + tree.high[k])[axis])

    def entry(node):
        with np.errstate(divide="ignore"):
            one, other = ((a[node] - origin) / direction for a in (tree.low, tree.high))
        near, far = max(np.minimum(one, other).max(), 0), np.maximum(one, other).min()
        return near if near <= far else np.inf

    def go(node, limit):
        if node < tree.size:
            away, _, inside = of_triangle((origin, direction), 0, vertices[node])[0]
            return [node], min(limit, away) if inside > 0 and away > 0 else limit
        seen = [node]
        pair = tree.children[node - tree.size]
        for child in sorted(pair, key=entry) if nearest_first else along(pair):
            if entry(child) < limit:
                more, limit = go(child, limit)
                seen += more
        return seen, limit

    return go(2 * tree.size - 2, np.inf) if entry(2 * tree.size - 2) < np.inf else ([], np.inf)


def soup(count, key, size=0.4):
    rng = np.random.default_rng(key)
    return rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))


@pytest.mark.parametrize("nearest_first", [True, False])
def test_traversal_is_that_of_a_recursion(nearest_first):
    """Node by node, with hits, from inside and outside; without rays; the order of rays does not matter."""
    vertices = soup(40, 1)
    tree = trees.optimal_subtrees(trees.surface_area_tree(vertices.min(axis=1), vertices.max(axis=1)))
    rng = np.random.default_rng(3)
    origin, direction = rng.normal(size=(150, 3)), rng.normal(size=(150, 3))
    distance = trees.triangle_distances(vertices, origin, direction)
    order = {"nearest_first": nearest_first}
    steps = []
    found = trees.nodes_visited(tree, origin, direction, distance, **order, visit=lambda *s: steps.append(s))
    expected = [visits(tree, o, d, vertices, **order)[0] for o, d in zip(origin, direction, strict=True)]
    assert np.array_equal(found, [len(nodes) for nodes in expected]) and found.dtype == np.int64
    ray, node = (np.concatenate(parts) for parts in zip(*steps, strict=True))
    assert [node[ray == k].tolist() for k in range(150)] == expected
    assert np.any(found < trees.nodes_visited(tree, origin, direction))
    assert trees.nodes_visited(tree, np.zeros((0, 3)), [0, 0, 1]).shape == (0,)
    square = (rays.reshape(10, 15, 3) for rays in (origin, direction))
    assert np.array_equal(trees.nodes_visited(tree, *square, distance, **order).reshape(-1), found)


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
    along = trees.nodes_visited(tree, [[-1, 0.5, 0], [-1, 0, 1], [0.5, 0.5, 5]], [1, 0, 0])
    across = trees.nodes_visited(tree, [[0.5, 0.5, -1], [0.5, 0.5, 0.5]], [0.0, 0, -2.0])
    assert (along.tolist(), across.tolist()) == ([2, 2, 0], [0, 2])


@pytest.mark.parametrize("dims", [3, 4])
def test_hilbert_trees_follow_a_curve_without_jumps(dims):
    """All cells of a grid: two that follow one another are neighbours; Morton order is that of the bits."""
    side = 8 if dims == 3 else 4
    low = np.array(list(product(range(side), repeat=dims)), float)
    low = low[np.random.default_rng(1).permutation(len(low))]
    along = low[members(trees.hilbert_tree(low, low))[-1]]
    assert np.all(abs(np.diff(along, axis=0)).sum(axis=1) == 1)
    along = low[members(trees.morton_tree(low, low))[-1]].astype(int)
    keys = [int("".join(str(x >> k & 1) for k in (2, 1, 0) for x in cell), 2) for cell in along]
    assert keys == sorted(keys)


def test_two_means_part_what_is_apart():
    """Whatever the key; with one box far from all others, with either norm, and boxes without extent."""
    low, high = boxes(50, 3)
    far = np.concatenate([low, low + 20.0])
    for norm, extent in ((2, high - low), (np.inf, 0 * low)):
        tree = trees.two_means_tree(far, far + np.concatenate([extent] * 2), norm=norm, key=3)
        halves = [set(members(tree)[k]) for k in tree.children[-1]]
        assert halves == [set(range(50)), set(range(50, 100))]


@pytest.mark.parametrize("norm", [2, np.inf])
def test_two_means_are_fixed_points(norm):
    """Boxes of the root are with the mean that is nearer, by diagonals of what holds both."""
    low, high = boxes(200, 6)
    tree = trees.two_means_tree(low, high, tries=1, norm=norm)
    parts = [members(tree)[k] for k in tree.children[-1]]
    weights = np.array([area(*box) for box in zip(low, high, strict=True)])
    means = [np.average((low + high)[of] / 2, axis=0, weights=weights[of]) for of in parts]
    apart = [np.linalg.norm(np.maximum(high, m) - np.minimum(low, m), norm, axis=1) for m in means]
    assert set(np.flatnonzero(apart[0] <= apart[1])) == set(parts[0])


def silhouette_width(low, high, parts):
    """Return the average over boxes, each beside all boxes of its own part and of the other."""

    def mean_distance(k, part):
        return np.mean([np.linalg.norm(np.subtract(*around(low, high, [k, j]))) for j in part if j != k])

    widths = []
    for part, other in (parts, parts[::-1]):
        for k in part:
            a, b = (mean_distance(k, of) if len(of) > 1 or k not in of else None for of in (part, other))
            widths.append(0 if a is None else (b - a) / max(a, b))
    return np.mean(widths)


def test_clusters_of_the_widest_silhouette():
    """Widths by their definition, of two nodes; a wider silhouette than by Eq. 4.1."""
    low, high = boxes(12, 4)
    side = np.arange(12) % 5 == 1
    found = _clusters._narrowness(low, high, side, np.array([0, 5]), np.array([5, 7]), 2)
    nodes = [([0, 2, 3, 4], [1]), ([5, 7, 8, 9, 10], [6, 11])]
    assert found == pytest.approx([-silhouette_width(low, high, parts) for parts in nodes])
    widths = []
    for silhouette in (False, True):
        tree = trees.two_means_tree(low, high, tries=64, silhouette=silhouette)
        widths.append(silhouette_width(low, high, [members(tree)[k] for k in tree.children[-1]]))
    assert widths[0] < widths[1]


def quadratic_split(low, high, of):
    """Split boxes by Guttman's algorithm, one step after the other."""

    def waste(pair):
        return area(*around(low, high, list(pair))) - sum(area(low[k], high[k]) for k in pair)

    groups = [[k] for k in max(combinations(of, 2), key=waste)]
    rest = [k for k in of if [k] not in groups]
    while rest:
        grows = [
            [area(*around(low, high, [*group, k])) - area(*around(low, high, group)) for group in groups]
            for k in rest
        ]
        place = max(range(len(rest)), key=lambda j: abs(grows[j][0] - grows[j][1]))
        sizes = [(grows[place][g], area(*around(low, high, groups[g])), len(groups[g])) for g in (0, 1)]
        groups[sizes.index(min(sizes))].append(rest.pop(place))
    return sorted(map(sorted, groups))


def test_quadratic_splits_are_guttmans():
    low, high = boxes(40, 9)
    tree = trees.quadratic_split_tree(low, high)
    found = members(tree)
    for node, pair in enumerate(tree.children, start=tree.size):
        assert sorted(sorted(found[k]) for k in pair) == quadratic_split(low, high, sorted(found[node]))


def fan(count):
    """Return the boxes of triangles around one vertex, that get thinner with their number."""
    angle = np.pi / 2 * 0.9 ** np.arange(count + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return np.minimum(0, np.minimum(rim[:-1], rim[1:])), np.maximum(0, np.maximum(rim[:-1], rim[1:]))


def test_a_fill_bounds_the_depth():
    low, high = fan(120)
    depth = [trees.node_depths(trees.quadratic_split_tree(low, high, fill=fill)).max() for fill in (0, 0.4)]
    assert depth[0] > 30 and depth[1] <= np.ceil(np.log(120) / np.log(1 / 0.62))


def moving(count, knots, key):
    rng = np.random.default_rng(key)
    first, far = rng.normal(size=(1, count, 3)), rng.choice([0, 0.05, 2], (1, count, 1))
    low = first + far * rng.normal(size=(knots, count, 3))
    times = np.cumsum(rng.uniform(0.1, 1, knots))
    return low, low + rng.uniform(0.01, 0.3, (1, count, 3)), times


def at(array, times, time):
    return np.stack([[np.interp(time, times, c) for c in row.T] for row in np.moveaxis(array, 1, 0)])


@pytest.mark.parametrize("knots", [2, 5])
def test_boxes_during_parts_of_the_shutter_are_tight(knots):
    low, high, times = moving(20, knots, 1)
    for start, end in ((0.0, 1.0), (0.2, 0.21), (0.3, 0.9), (0.4, 0.4)):
        ends = times[0] + np.array([start, end]) * (times[-1] - times[0])
        found = trees.boxes_during(low, high, times, *ends)
        dense = np.concatenate([np.linspace(*ends, 50), times[(times > ends[0]) & (times < ends[1])]])
        assert np.allclose(found[0], np.min([at(low, times, t) for t in dense], axis=0), rtol=0, atol=1e-12)
        assert np.allclose(found[1], np.max([at(high, times, t) for t in dense], axis=0), rtol=0, atol=1e-12)
    whole = trees.boxes_during(low, high, times)
    assert np.array_equal(whole[0], low.min(axis=0)) and np.array_equal(whole[1], high.max(axis=0))


@pytest.mark.parametrize("kappa", [1.0, 2.0, 5.0])
def test_parts_in_time_hold_what_moves(kappa):
    """At each time one part of each box, that holds it; none is too large; half as many would not do."""
    low, high, times = moving(60, 4, 2)
    lows, highs, number = trees.split_in_time(low, high, times, kappa, most=32)
    whole = trees.surface_area(*trees.boxes_during(low, high, times))
    counts = np.bincount(number, minlength=60)
    assert set(counts) <= {1, 2, 4, 8, 16, 32} and (kappa == 1) == (max(counts) == 1)
    areas = trees.surface_area(lows[:, :3], highs[:, :3])
    split = counts[number] > 1
    assert np.all((areas <= whole[number] / kappa)[split & (counts[number] < 32)])
    assert np.array_equal(areas[~split], whole[number[~split]])
    # What stays whole would be too large at one time alone.
    largest = trees.surface_area(low, high).max(axis=0)
    assert kappa == 1 or np.array_equal(counts == 1, largest > whole / kappa)
    for k in np.flatnonzero(counts > 1):
        cuts = np.linspace(times[0], times[-1], counts[k] // 2 + 1)
        parts = [trees.boxes_during(low[:, [k]], high[:, [k]], times, *c) for c in pairwise(cuts)]
        assert max(float(trees.surface_area(*part)[0]) for part in parts) > whole[k] / kappa
    for time in np.random.default_rng(3).uniform(times[0], times[-1], 30):
        now = (lows[:, 3] <= time) & (time < highs[:, 3])
        assert np.array_equal(number[now], np.arange(60))
        assert np.all(lows[now, :3] <= at(low, times, time) + 1e-12)
        assert np.all(highs[now, :3] >= at(high, times, time) - 1e-12)


def test_boxes_that_are_large_at_one_time_stay_whole():
    """And are hit from the first to the last time, both of them included."""
    low, high = np.zeros((2, 1, 3)), np.ones((2, 1, 3)) * [[[1.0]], [[10.0]]]
    lows, highs, number = trees.split_in_time(low, high, [1.0, 3.0])
    assert (lows.tolist(), highs.tolist(), number.tolist()) == ([[0, 0, 0, 1]], [[10, 10, 10, 3]], [0])
    tree, ray = trees.surface_area_tree(lows, highs), ([[5, 5, -1]] * 5, [0, 0, 1])
    assert trees.nodes_visited(tree, *ray, time=[0.9, 1.0, 2.0, 3.0, 3.1]).tolist() == [0, 1, 1, 1, 0]


def hits(tree, rays, vertices, times, time, number=None):
    """Return the nearest distances that a traversal comes across, and the visits."""
    found = np.full(len(time), np.inf)
    distance = trees.triangle_distances(vertices, *rays, times=times, time=time, number=number)

    def noted(some, leaves):
        away = distance(some, leaves)
        found[some] = np.minimum(found[some], away)
        return away

    return found, trees.nodes_visited(tree, *rays, noted, time=time)


def test_four_ways_over_motion_find_the_same_hits():
    """Boxes for the whole shutter, interpolated ones, a tree for each part of it, and boxes split in time."""
    ends = np.stack([soup(300, 3, 0.1), soup(300, 3, 0.1) + soup(300, 4, 0.0) * 0.7])
    times = np.array([0.0, 1.0])
    low, high = ends.min(axis=2), ends.max(axis=2)
    rng = np.random.default_rng(5)
    rays, time = (rng.normal(size=(2000, 3)), rng.normal(size=(2000, 3))), rng.uniform(size=2000)
    tree = trees.surface_area_tree(*trees.boxes_during(low, high, times))
    expected, visited = hits(tree, rays, ends, times, time)
    lows, highs, number = trees.split_in_time(low, high, times)
    split = trees.surface_area_tree(lows, highs)
    assert 0.1 < np.mean(np.isfinite(expected)) < 0.9
    for other, given in ((trees.refitted(tree, low, high, times), None), (split, number)):
        found, count = hits(other, rays, ends, times, time, given)
        assert np.array_equal(found, expected) and count.mean() < visited.mean()
    for start in (0.0, 0.5):
        part = trees.surface_area_tree(*trees.boxes_during(low, high, times, start, start + 0.5))
        now = (time >= start) & (time < start + 0.5)
        few = tuple(a[now] for a in rays)
        found, count = hits(part, few, ends, times, time[now])
        assert np.array_equal(found, expected[now]) and count.mean() < visited[now].mean()


TREE, IN_TIME = (trees.surface_area_tree(*of) for of in (boxes(4, 0), SETS["in time"]))
UP = ([0.0, 0, 0], [0.0, 0, 1])
test_mistakes_are_named = refused(
    (trees.refitted, TREE, TREE.low[:2], TREE.high[:2], "low must have 4 boxes"),
    (trees.nodes_visited, TREE, TREE.low[:1] - UP[1], UP[1], lambda *_: np.ones(9), r"distance .*\(1,\).*9"),
    (trees.nodes_visited, IN_TIME, *UP, TypeError, "time must be given"),
)
