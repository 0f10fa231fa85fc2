import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import dispersion
from analysis._distances import dispersion as _dispersion

ULP = 2.0**-53


def brute_force(points, torus):
    """Take the largest empty sphere of all that touch points, with centres in the cube or on its boundary.

    The centre lies on a face of the cube (or inside of it) where the same number of independent distances
    are equal: every set of points and of fixed coordinates that determines a centre is tried.
    """
    dims = points.shape[1]
    if torus:
        points = np.concatenate([points + step for step in itertools.product((-1, 0, 1), repeat=dims)])
    points = np.unique(points, axis=0)
    best = 0.0
    for fixed in itertools.product((None, 0.0, 1.0), repeat=dims) if not torus else [(None,) * dims]:
        free = [k for k in range(dims) if fixed[k] is None]
        base = np.array([0.0 if c is None else c for c in fixed])
        chosen = np.array(list(itertools.combinations(range(len(points)), len(free) + 1)))
        if not len(chosen):
            continue
        corners = points[chosen]
        matrix = 2 * (corners[:, 1:, free] - corners[:, :1, free])
        square = np.square(corners - base).sum(axis=2)
        right = square[:, 1:] - square[:, :1]
        regular = np.abs(np.linalg.det(matrix)) > 1e-12 if free else np.ones(len(chosen), bool)
        centres = np.tile(base, (np.count_nonzero(regular), 1))
        centres[:, free] = np.linalg.solve(matrix[regular], right[regular][..., None])[..., 0]
        centres = centres[((centres >= -1e-9) & (centres <= 1 + 1e-9)).all(axis=1)]
        for part in np.array_split(centres, 1 + len(centres) // 4096):
            if len(part):
                distances = np.square(part[:, None] - points[None]).sum(axis=2).min(axis=1)
                best = max(best, math.sqrt(distances.max()))
    return best


@st.composite
def sets(draw):
    """Few points: spread, clustered, on a coarse grid with duplicates, on a line, on the boundary."""
    dims = draw(st.integers(1, 3))
    torus = draw(st.booleans())
    count = draw(st.integers(1, (20, 4, 1)[dims - 1] if torus else (20, 9, 6)[dims - 1]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    points = rng.random((count, dims))
    kind = draw(st.sampled_from(["random", "cluster", "grid", "line", "boundary"]))
    if kind == "cluster":
        points = (points[0] + points / 50) % 1
    elif kind == "grid":
        points = np.floor(points * 4) / 4
    elif kind == "line":
        points[:, 1:] = 0.5
    elif kind == "boundary":
        points = np.where(rng.random((count, dims)) < 0.5, rng.choice([0, 1 - ULP], (count, dims)), points)
    return points, torus


@settings(max_examples=80)
@given(sets())
def test_equals_brute_force(drawn):
    points, torus = drawn
    assert dispersion(points, torus) == pytest.approx(brute_force(points, torus), rel=1e-9)


@pytest.mark.parametrize("dims", [1, 2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize("kind", ["random", "cluster", "halves"])
def test_between_bounds_of_a_mesh(dims, torus, kind):
    """The distance is 1-Lipschitz: its maximum over a mesh misses at most half a diagonal of the mesh."""
    points = np.random.default_rng(dims).random((300, dims))
    if kind == "cluster":
        points = (points / 10 + 0.9) % 1
    elif kind == "halves":
        points[:, 0] /= 2
    side = (4000, 150, 24)[dims - 1]
    axis = np.arange(side + 1) / side
    mesh = np.stack(np.meshgrid(*[axis] * dims), axis=-1).reshape(-1, dims)
    best = np.full(len(mesh), np.inf)
    for point in points:
        delta = np.abs(mesh - point)
        delta = np.minimum(delta, 1 - delta) if torus else delta
        np.minimum(best, np.square(delta).sum(axis=1), out=best)
    lower = math.sqrt(best.max())
    assert lower - 1e-12 <= dispersion(points, torus) <= lower + math.sqrt(dims) / 2 / side


@pytest.mark.parametrize("at_a_time", [1, 4096])
@pytest.mark.parametrize("dims", [1, 2, 3])
def test_grids(dims, at_a_time, monkeypatch):
    """A cubic grid: half the diagonal of its cell on the torus; in the cube the far corner, a whole one.

    The corners of its cells lie on one sphere, or almost: a triangulation may have flat simplices of wrong
    centres.
    """
    monkeypatch.setattr(_dispersion, "_ALIKE", at_a_time)
    for side in (1, 2, 7, (100, 30, 9)[dims - 1]):
        grid = np.indices((side,) * dims).reshape(dims, -1).T / side
        assert dispersion(grid) == pytest.approx(math.sqrt(dims) / 2 / side, rel=1e-12)
        shaken = (grid + np.random.default_rng(1).random(grid.shape) * 1e-13) % 1
        assert dispersion(shaken) == pytest.approx(math.sqrt(dims) / 2 / side, rel=1e-10)
        assert dispersion(grid, torus=False) == pytest.approx(math.sqrt(dims) / side, rel=1e-12)
        centred = grid + 0.5 / side
        assert dispersion(centred, torus=False) == pytest.approx(math.sqrt(dims) / 2 / side, rel=1e-12)


@pytest.mark.parametrize("torus", [True, False])
@pytest.mark.parametrize(("dims", "n"), [(2, 2000), pytest.param(3, 16000, marks=pytest.mark.slow)])
def test_blocks(dims, n, torus, monkeypatch):
    """What is found in blocks is what is found in the whole, where the largest hole may be anywhere."""
    blocks = []
    plain = _dispersion._largest_ball

    def counted(points, low, *rest):
        blocks.append(tuple(low))
        return plain(points, low, *rest)

    monkeypatch.setattr(_dispersion, "_largest_ball", counted)
    rng = np.random.default_rng(6)
    spread = rng.random((n, dims))
    side = round(n ** (1 / dims))
    grid = np.indices((side,) * dims).reshape(dims, -1).T / side
    hole = spread[(np.abs((spread - rng.random(dims) + 0.5) % 1 - 0.5) > 0.6 / side).any(axis=1)]
    many = spread, grid, hole, (grid + rng.random(dims)) % 1, np.tile(spread, (2, 1))
    for points in many[: 5 if dims == 2 else 2]:
        found = []
        for together in (n // 40, 2 * n):
            monkeypatch.setattr(_dispersion, "_TOGETHER", together)
            blocks.clear()
            found.append(dispersion(points, torus))
            assert len(set(blocks)) == len(blocks)
            assert (len(blocks) > 1) == (together < n)
        assert found[0] == pytest.approx(found[1], rel=1e-15)


@pytest.mark.parametrize("torus", [True, False])
def test_blocks_are_no_smaller_than_a_hole_allows(torus, monkeypatch):
    """However few points a block may have, as many as around it decide about a disc of radius 0.07."""
    for key in range(4):
        rng = np.random.default_rng(key)
        spread, centre = rng.random((2000, 2)), rng.random(2)
        points = spread[np.linalg.norm((spread - centre + 0.5) % 1 - 0.5, axis=1) > 0.07]
        found = []
        for together in (1, 4000):
            monkeypatch.setattr(_dispersion, "_TOGETHER", together)
            found.append(dispersion(points, torus))
        assert found[0] == pytest.approx(found[1], rel=1e-15)


def test_body_centred_lattice():
    """Its covering radius is sqrt(5)/4 times the side of the cubic cell; no vertex lies on the mesh."""
    cubic = np.indices((5, 5, 5)).reshape(3, -1).T
    points = np.concatenate([cubic, cubic + 0.5]) / 5
    assert dispersion(points) == pytest.approx(math.sqrt(5) / 4 / 5, rel=1e-12)


@pytest.mark.parametrize("dims", [2, 3])
def test_symmetries(dims):
    """Translations preserve it on the torus, reflections and permutations of axes in the cube, too."""
    points = np.random.default_rng(1).random((200, dims))
    moved = (points + np.random.default_rng(2).random(dims)) % 1
    assert dispersion(moved) == pytest.approx(dispersion(points), rel=1e-9)
    for torus in (True, False):
        turned = np.where(np.arange(dims) == 1, 1 - points, points)[::-1, ::-1]
        assert dispersion(turned, torus) == pytest.approx(dispersion(points, torus), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("dims", "n"), [(2, 2**17), (3, 2**14)])
def test_many_points(dims, n):
    """Covering needs at least the ball's volume over n, and random points about log(n) times as much."""
    found = dispersion(np.random.default_rng(5).random((n, dims)))
    volume = n * math.pi ** (dims / 2) / math.gamma(dims / 2 + 1) * found**dims
    assert 1 < volume / math.log(n) < 3
