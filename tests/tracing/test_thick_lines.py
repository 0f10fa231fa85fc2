"""Moving thick lines as moving triangles: how long they cover a point, against dense times (thesis, 3.2)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from qmcjax import tracing

BOUNDS = {"float32": 1e-6, "float64": 1e-12}


def quadrilateral(ends, width):
    """Return the corners of lines of a width between ends (..., 2, 2): (..., 4, 2), round."""
    along = ends[..., 1, :] - ends[..., 0, :]
    across = (
        np.stack([-along[..., 1], along[..., 0]], axis=-1) * (0.5 * width / np.hypot(*along.T))[..., None]
    )
    return np.stack([ends[..., 0, :] - across, ends[..., 1, :] - across, ends[..., 1, :] + across,
                     ends[..., 0, :] + across], axis=-2)  # fmt: skip


def inside(opened, closed, time):
    """Tell whether 0 is in quadrilaterals at times: (n, 4, 2) twice, (n, m) to (n, m)."""
    corners = (1 - time)[..., None, None] * opened[:, None] + time[..., None, None] * closed[:, None]
    after = np.roll(corners, -1, axis=-2)
    areas = corners[..., 0] * after[..., 1] - corners[..., 1] * after[..., 0]
    return (areas >= 0).all(axis=-1) | (areas <= 0).all(axis=-1)


def dense(opened, closed, count=2048):
    """Return how long quadrilaterals cover 0: dense times, and their changes bisected."""
    time = np.broadcast_to(np.arange(count + 1) / count, (len(opened), count + 1))
    hit = inside(opened, closed, time)
    covered = hit[:, 0] * 0.0 + hit[:, -1]
    row, change = np.nonzero(hit[:, 1:] != hit[:, :-1])
    low, high = time[row, change], time[row, change + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = inside(opened[row], closed[row], middle[:, None])[:, 0] == hit[row, change]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    # The end of an interval counts, its start is taken off.
    np.add.at(covered, row, np.where(hit[row, change], high, -high))
    return covered


@pytest.mark.slow
@pytest.mark.parametrize("dtype", BOUNDS)
def test_coverage_of_points_by_moving_thick_lines(dtype):
    """Lines that slide and turn: exact but where dense times or a grazing side tell too little."""
    rng = np.random.default_rng(1)
    count = 400
    first = rng.uniform(-1, 1, size=(count, 2, 2))
    last = first + rng.uniform(-1, 1, size=(count, 1, 2))
    turns = np.arange(count) % 2 == 0
    last[turns] += rng.uniform(-0.3, 0.3, size=(count // 2, 2, 2))
    corners = [quadrilateral(ends, 0.2).astype(dtype) for ends in (first, last)]
    with jax.enable_x64(dtype == "float64"):
        flat = [np.concatenate([c, np.ones_like(c[..., :1])], axis=-1) for c in corners]
        halves = [np.stack([f[:, [0, 1, 2]], f[:, [0, 2, 3]]], axis=1) for f in flat]

        @jax.jit
        @jax.vmap
        def covered(opened, closed):
            world = tracing.world([tracing.triangles(opened, closed)])
            ahead = jnp.array([0, 0, 1], opened.dtype)
            seen = tracing.visible_intervals(world, 0 * ahead, ahead, 8)
            return jnp.sum(seen.end - seen.start), seen.until

        found, until = (np.asarray(a) for a in covered(*(jnp.asarray(half) for half in halves)))
    assert np.all(until == 1)
    error = abs(found.astype(np.float64) - dense(*(c.astype(np.float64) for c in corners)))
    assert np.mean(found > 0) > 0.1
    assert np.mean(error < BOUNDS[dtype]) > 0.99
    assert np.max(error) < 2e-3
