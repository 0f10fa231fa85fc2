"""Print a hash of what each kind of object returns: ``test_settings.py`` runs this under settings of JAX."""

import hashlib

import jax
import jax.numpy as jnp
import numpy as np
import tables
from scene_tables import MOTION, PLANE

import qmcjax as qj

SEQUENCES = ("sobol(9)", "halton, zaremba", "uniform(3)", "owen(sobol(2))", "rotate(halton(12))")
SEQUENCES += ("rank1_lattice(1700, 3)", "latin_hypercube(2**32)", "owen(halton(3))")
SAMPLERS = ("independent, owen", "contiguous, morton, owen", "partitioned, hilbert, halton", "tiled, boxes")
SAMPLERS += ("tiled, boxes", "z, hash")
# The last bit of an exponential depends on how it is compiled.
SCENES = {"disc": PLANE["disc"], "ball": MOTION["ball"]}
SIDE, SPP = tables.SIDE, tables.SPP

evaluated = jax.jit(lambda function, *args: function(*args))
positions = jax.jit(lambda order, x, y: order.position(x, y))
# Objects are made on the host, of constants.
with jax.transfer_guard("allow"):
    sequences = {name: tables.SEQUENCES[name] for name in SEQUENCES}
    samplers = {name: tables.SAMPLERS[name] for name in SAMPLERS}
    orders = {name: maker(SIDE, SIDE) for name, maker in tables.ORDERS.items()}
    index = jnp.arange(64, dtype=jnp.uint32)
    x, y, sample = index % 8, index // 8, index % SPP
    slope = jnp.float32(2)
    mesh = jax.make_mesh((jax.device_count(),), ("devices",))


def mean(scene):
    return qj.render(scene, samplers["z, hash"], SIDE, SIDE, SPP, mesh=mesh).mean()


def value(slope, point):
    return slope * point[..., 0] ** 2


def of_closure(slope):
    return mean(qj.scenes.function(lambda point: value(slope, point), ("x", "y")))


@jax.jit
@jax.grad
def gradient(slope):
    return mean(qj.scenes.function(jax.tree_util.Partial(value, slope), ("x", "y")))


def found():
    for name, sequence in sequences.items():
        yield name, evaluated(sequence, index), sequence.points(16)
    for name, order in orders.items():
        yield name, positions(order, x, y)
    for name, sampler in samplers.items():
        yield name, evaluated(sampler, x, y, sample)
    for name, scene in SCENES.items():
        yield name, qj.render(scene, samplers["tiled, boxes"], SIDE, SIDE, SPP, mesh=mesh)
    yield "gradient", gradient(slope)
    with jax.transfer_guard("allow"):  # jax.grad transfers a 1.
        yield "gradient through a closure", jax.grad(of_closure)(slope)
    yield "integral", qj.integrate(lambda point: point[..., 0] ** 2, sequences["owen(sobol(2))"], 256)


for name, *arrays in found():
    print(hashlib.sha256(b"".join(np.asarray(array).tobytes() for array in arrays)).hexdigest(), name)
