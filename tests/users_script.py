"""A script as users write it, checked by ``test_types.py``; lines that end in ``# error`` must be refused."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp
from jax import Array

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing


class MySequence:
    dims = 2

    def __call__(self, index: Array) -> Array:
        return jnp.stack([index, index], axis=-1) / 2.0**32


class MyOrder:
    width = height = 8
    length = 64

    def position(self, x: Array, y: Array) -> Array:
        return 8 * y + x


class MySampler:
    dims = 2

    def __call__(self, x: Array, y: Array, sample: Array, dims: tuple[int, ...], dtype: Any) -> Array:
        return jnp.stack([x / 8, y / 8], axis=-1)[..., : len(dims)].astype(dtype)


class MyScene:
    needs = ("x", "y")

    def __call__(self, point: Array) -> Array:
        return point[..., 0]


sequence, order, scene = sequences.owen(sequences.sobol(2), key=1), orders.hilbert(8, 8), scenes.disc()
sampler = samplers.contiguous(order, sequence, 4)
points: Array = sampler(0, 0, 3)
camera = tracing.camera((0, 0, 5), (0, 0, 0))
traced = tracing.direct_light(tracing.world([tracing.sphere((0, 0, 0), 1)], []), camera)
image: Array = qj.render(scene, sampler, 8, 8, 4, checkpoint=Path("image.npz"))
for each in (MyScene(), traced, scenes.cornell_box(), scenes.function(lambda p: p[..., 0], ("x", "y"))):
    qj.render(each, MySampler(), 8, 8, 4)
    qj.render_adaptive(each, samplers.independent(MySequence(), 1), 8, 8, 4)
print(samplers.shifted(MyOrder(), sequences.rotate(MySequence(), key=1), sequence).dims, points, image)
print(qj.integrate(lambda p: p[..., 0], MySequence(), 64), qj.recommend(MyScene(), 4).sampler(8, 8, 1).dims)
print(qj.integrate(lambda p: p[..., 0], sequence, 64, replicates=4, key=1).interval(0.95)[0])
table = analysis.convergence(scene, {"mine": MySampler(), "owen": sampler}, [4])
print(analysis.star_discrepancy(sequence.points(8)), analysis.min_distance(sequence.points(8)), table)
print(analysis.segment_counts(MyOrder()).sum(), analysis.broken_promises(MySampler(), 8, 8, 4))

qj.render(sampler, scene, 8, 8, 4)  # error
qj.render(sequence, sampler, 8, 8, 4)  # error
qj.render(scene, sequence, 8, 8, 4)  # error
qj.integrate(lambda p: p[..., 0], sampler, 64)  # error
samplers.contiguous(sequence, order, 4)  # error
samplers.partitioned(orders.hilbert3(8, 8, 2), sequence)  # error
