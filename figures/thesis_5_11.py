"""Thesis Fig. 5.11: padded replications, one net shifted by whole pixels and jittered."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import analysis
from figures import _points
from qmcjax import samplers, sequences

SIDE, INSTANCES = 8, 4


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Draw four instances over 8 x 8 pixels, and all of them together."""
    del quality, progress
    net = sequences.larcher_pillichshammer_net(6)
    sampler = samplers.padded_replications(net, SIDE, SIDE, offsets=0)
    y, x = (jnp.asarray(a.ravel()) for a in np.mgrid[0:SIDE, 0:SIDE].astype(np.uint32))
    pixels = np.stack([x, y], axis=1)
    instances = [
        (pixels + np.asarray(sampler(x, y, jnp.full_like(x, k), dtype=jnp.float64))) / SIDE
        for k in range(INSTANCES)
    ]
    together = np.concatenate(instances)
    figure, axes = _points.panels(
        INSTANCES + 1, "Padded replications: one net, shifted by whole pixels and jittered (thesis Fig. 5.11)"
    )
    for k, instance in enumerate(instances):
        _points.scatter(axes[k], instance, f"instance {k}", color=f"C{k}")
        _points.scatter(axes[-1], instance, "superimposed", color=f"C{k}")
    for panel in axes:
        _points.grid(panel, SIDE, SIDE)
    shifts = np.asarray(sampler.offsets.points(INSTANCES, dtype=jnp.float64))[:, :2] * SIDE
    frames = np.asarray(sequences.sobol(2).points(SIDE * SIDE * INSTANCES, dtype=jnp.float64))
    measured = {
        "pixels with one sample of each instance": [
            len(np.unique(np.floor(i * SIDE), axis=0)) for i in instances
        ],
        "shifts in pixels": shifts.astype(int).tolist(),
        "minimum distance of the net": analysis.min_distance(_points.block(net, net.size)),
        "minimum distance of each instance": [analysis.min_distance(i) for i in instances],
        "minimum distance superimposed": analysis.min_distance(together),
        "the same of four frames of the Sobol' sequence": analysis.min_distance(frames),
        "instance is a (0,6,2)-net": [_points.holds_one_each(i, 6) for i in instances],
        "superimposed they are a (0,8,2)-net": _points.holds_one_each(together, 8),
    }
    return figure, {
        "measured": measured,
        "printed": "always exactly one sample in each pixel, and each set is well stratified over the "
        "screen; superimposed, the samples can lie arbitrarily close together",
        "note": "Toroidal distances. The net is Larcher and Pillichshammer's, as in the programs of the "
        "thesis, which does not give the shifts. These keep distances, but not all elementary intervals.",
    }
