"""A script as users write it (``test_package.py``); lines that end in ``# error`` must be refused."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
from jax import Array

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing


class Mine:
    """A sequence, an order and a scene at the same time."""

    dims, width, height, length, needs = 2, 8, 8, 64, ("x", "y")

    def position(self, x: Array, y: Array) -> Array:
        return 8 * y + x

    def __call__(self, given: Array) -> Array:
        return jnp.stack([given, given], axis=-1) / 2.0**32


class MySampler:
    dims = 2

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: Any) -> Array:
        return jnp.stack([x / 8, y / 8], axis=-1)[..., : len(dims)].astype(dtype)


sequence, order, scene = sequences.owen(sequences.sobol(2), key=1), orders.hilbert(8, 8), scenes.disc()
sampler = samplers.contiguous(order, sequence, 4)
world = tracing.world([tracing.sphere((0, 0, 0), 1)], [])
traced = tracing.direct_light(world, tracing.camera((0, 0, 5), (0, 0, 0)))
arrays: list[Array] = [sampler(0, 0, 3), qj.render(scene, sampler, 8, 8, 4, checkpoint=Path("image.npz"))]
for each in (Mine(), traced, scenes.cornell_box(), scenes.function(lambda p: p[..., 0], ("x", "y"))):
    qj.render_adaptive(each, samplers.independent(Mine(), 1), 8, 8, 4)
    arrays.append(qj.render(each, MySampler(), 8, 8, 4))
print(samplers.shifted(Mine(), sequences.rotate(Mine(), key=1), sequence).dims, qj.recommend(Mine(), 4).spp)
print(qj.integrate(lambda p: p[..., 0], Mine(), 64, replicates=4, key=1).interval(0.95)[0], arrays)
print(analysis.convergence(scene, {"mine": MySampler(), "owen": sampler}, [4]).rows)
print(analysis.star_discrepancy(sequence.points(8)), analysis.segment_counts(Mine()).sum())

qj.render(sampler, scene, 8, 8, 4)  # error
qj.render(sequence, sampler, 8, 8, 4)  # error
qj.render(scene, sequence, 8, 8, 4)  # error
qj.integrate(lambda p: p[..., 0], sampler, 64)  # error
samplers.contiguous(sequence, order, 4)  # error
samplers.partitioned(orders.hilbert3(8, 8, 2), sequence)  # error
