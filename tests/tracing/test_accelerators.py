"""Programs for GPUs and TPUs, lowered on a processor: what is in them that would be slow or wrong there.

``jax.export`` lowers a program for platforms that are not at hand. No test here runs one.
"""

import re
from fnmatch import fnmatchcase
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import tables
from jax.core import Tracer
from jax.sharding import AxisType
from tables import KINDS, ORDERS, SAMPLERS, SEQUENCES, few, slow

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import backends, pytrees

PLATFORMS = ("cuda", "rocm", "tpu")

COUNT = 1024
"""Samples: what is gathered for fewer is no cost of a sample."""

WORDS = jax.ShapeDtypeStruct((COUNT,), jnp.uint32)

TABLES = {
    pattern: what
    for what, patterns in {
        "permutations of digits": (
            "halton, *; owen(halton*; digit_scramble(*; full_screen, halton, random; partitioned, *; "
            "shifted, hilbert, lattice"
        ),
        "matrices of digits": "owen_exact(faure*; faure(10); faure(5, modified); quad_optimized(*",
        "random trees": "art_owen(*; scrambled_morton, tree; full_screen, art; z, tree",
        "points found by iteration or search": "lloyd(*; net_by_net(*; pmj02(*",
        "orders found by search": "optimized; progressive*",
        "masks and ranks": "dither, *; ranked",
        "tiles of points": "designed; tiled, *",
        "the user's counts of samples": "z, plain, counts",
    }.items()
    for pattern in patterns.split("; ")
}
"""Objects, by patterns of their names, that look things up for each sample, and what that is."""

FRACTIONS = (
    "van_der_corput(7); van_der_corput(65536); halton[(,]*; faure(10); faure(5, modified); quad_optimized(*; "
    "rotate(halton*; korobov(*; rank1_lattice(1700*; owen(halton*; owen_exact(faure*; digit_scramble(*; "
    "independent, shift; full_screen, halton*; contiguous, raster, halton; segments, hilbert, halton; "
    "partitioned, *; shifted, hilbert, lattice; dither, numbers; designed; tiled, *"
).split("; ")
"""Objects, by patterns of their names, whose fractions are roots or have a denominator that is no power of 2:
what exceeds a word is joined in float64, and rounded once."""

HIT = "what a ray hit: rows of vertices, materials and lights"

DEVICE_CALLS = {"cu_threefry2x32_ffi", "hip_threefry2x32_ffi"}
"""Kernels of JAX's own on GPUs, called by name: random numbers for keys."""


def lowered(function, *args) -> str:
    """Return the program for all platforms; one with a callback of Python's cannot be exported."""
    return jax.export.export(jax.jit(function), platforms=PLATFORMS)(*args).mlir_module()


def lookups(text: str) -> list[str]:
    """Return the operand types of gathers that have a result for each sample."""
    found = re.findall(r'"stablehlo\.(?:dynamic_)?gather".*: \(tensor<(\w+)>, .*-> tensor<([\dx]*)\w+>', text)
    return [table for table, shape in found if np.prod([int(n) for n in shape.split("x") if n]) >= COUNT]


def check(text: str, tables: str | None = None, fractions: bool = False) -> None:
    """Compare what is in a program with what is allowed, both ways: lists do not grow old."""
    assert set(re.findall(r"custom_call @([\w.]+)", text)) <= DEVICE_CALLS
    assert not re.search(r"stablehlo\.(infeed|outfeed|send|recv)\b", text)
    assert bool(re.search(r"\bf64\b|xf64\b", text)) == fractions
    assert bool(lookups(text)) == (tables is not None), lookups(text)


def listed(name: str, names) -> str | None:
    """Return the pattern that a name fits."""
    return next((pattern for pattern in names if fnmatchcase(name, pattern)), None)


def allowed(name: str) -> dict:
    return {"tables": listed(name, TABLES), "fractions": listed(name, FRACTIONS) is not None}


@pytest.mark.parametrize(
    "name",
    few(
        (*KINDS, "halton(3)", "korobov(2000)", "quad_optimized(6)"),
        "owen(sobol(2))",
        "halton(3)",
        "permutation_net_3d(11)",
    ),
)
def test_sequences(name):
    sequence = SEQUENCES[name]
    n = min(COUNT, sequence.size or COUNT)
    text = lowered(lambda sequence, index: (sequence(index), sequence.points(n)), sequence, WORDS)
    check(text, **allowed(name))


@pytest.mark.parametrize("name", few(ORDERS, "hilbert"))
def test_orders(name):
    order = ORDERS[name](32, 32)
    check(lowered(lambda order, x: (order.position(x, x), order.pixel(x)), order, WORDS), **allowed(name))


@pytest.mark.parametrize("name", few(SAMPLERS, "z, hash", "full_screen, halton, random"))
def test_samplers(name):
    sampler = SAMPLERS[name]
    dims = tuple(range(sampler.dims))
    check(lowered(lambda sampler, x: sampler(x, x, x, dims, jnp.float32), sampler, WORDS), **allowed(name))


@pytest.mark.parametrize(
    "name",
    few(
        ("contiguous, hilbert, sobol", "contiguous, raster, halton", "z, hash", "optimized", "ranked"),
        "contiguous, hilbert, sobol",
    ),
)
def test_images(name):
    """Rendering takes samples in batches: other programs than those of single samples, with their tables."""
    sampler = SAMPLERS[name]
    sides, spp = 32, getattr(sampler, "spp", 4)
    scene = scenes.function(lambda point: point.sum(axis=-1), tuple("xyuvw"[: sampler.dims]))
    text = lowered(lambda sampler: qj.render(scene, sampler, sides, sides, min(spp, 4)), sampler)
    check(text, **allowed(name))


@pytest.mark.slow
def test_images_on_two_devices():
    """Spread over a mesh: what the devices tell each other is not told by the host."""
    mesh = jax.make_mesh((2,), ("device",), axis_types=(AxisType.Auto,))
    sampler = SAMPLERS["contiguous, hilbert, sobol"]
    text = lowered(lambda sampler: qj.render(scenes.disc(), sampler, 32, 32, 4, mesh=mesh), sampler)
    assert "mhlo.num_partitions = 2" in text
    check(text)


SCENES = {
    name: getattr(scenes, name)
    for name in (
        "checkerboard zone_plate disc triangle gaussian ramp step line staircase heaviside product "
        "flat_checkerboard moving_edge defocused_edge soft_shadow blinking_disc ball"
    ).split()
} | {
    "path_toy": partial(scenes.path_toy, 2),
    "genz, oscillatory": lambda: scenes.genz("oscillatory", 3),
    "genz, corner_peak": lambda: scenes.genz("corner_peak", 3),
}


def image(scene):
    sampler = samplers.independent(sequences.sobol(len(scene.needs)), key=3)
    return qj.render(scene, sampler, 32, 32, 1)


@pytest.mark.parametrize("name", few(SCENES, "disc"))
def test_scenes(name):
    check(lowered(image, SCENES[name]()))


@pytest.mark.parametrize("name", slow("zone_plate", "gaussian", "genz, oscillatory"))
def test_derivatives_of_scenes(name):
    check(lowered(jax.value_and_grad(lambda scene: image(scene).sum()), SCENES[name]()))


@pytest.fixture
def accelerator(monkeypatch):
    """Let programs be traced as where the default device is no processor: without Numba's loops and tiles."""
    tables.sizes(monkeypatch, backends.GPU)


def fan(count):
    """Return triangles around a point."""
    ends = np.linspace(0, 2 * np.pi, count + 1)
    ring = np.stack([np.cos(ends), np.sin(ends), np.full(count + 1, -2.0)], axis=1)
    return np.stack([np.broadcast_to([0.0, 0.0, -2.5], (count, 3)), ring[:-1], ring[1:]], axis=1)


def lit(materials, lights=1):
    """Return a world of a plane, a ball that moves, and a mesh, in the light of some lights."""
    up = tracing.motion.affine(None, tracing.motion.linear_segments([0.0, 1.0], [[0.0] * 3, [0.0, 0.2, 0.0]]))
    objects = [
        tracing.plane([0, -1, 0], [0, 1, 0], material=materials[0]),
        tracing.sphere([0, 0, -3], 0.5, motion=up, material=materials[1]),
        tracing.triangles(fan(8), material=materials[-1]),
    ]
    shining = [
        tracing.rectangle_light([-1, 3, -1], [2, 0, 0], [0, 0, 2], radiance=4.0),
        tracing.point_light([0, 2, 0], 3.0),
        tracing.sphere_light([2, 2, 0], 0.2, 3.0),
    ]
    return tracing.world(objects, shining[:lights])


CAMERA = tracing.camera([0, 0.5, 2], [0, 0, -3], aperture=0.05)
MATERIALS = (
    tracing.diffuse(tracing.checker(0.7, 0.2)),
    tracing.glossy(0.04, 0.2, [0.6, 0.1, 0.1]),
    tracing.mirror(0.9),
)
TRACED = {
    "direct_light": lambda: tracing.direct_light(lit(MATERIALS[:2], 3), CAMERA),
    "path_tracing": lambda: tracing.path_tracing(lit(MATERIALS), CAMERA, bounces=2),
    "bidirectional": lambda: tracing.bidirectional(lit(MATERIALS), CAMERA, bounces=1),
}


@pytest.mark.parametrize("name", slow(*TRACED))
def test_traced_scenes(accelerator, name):
    check(lowered(image, TRACED[name]()), HIT)


@pytest.mark.slow
def test_derivatives_of_traced_scenes(accelerator):
    def total(colour):
        matter = tracing.diffuse(colour)
        return image(tracing.direct_light(lit((matter, matter)), CAMERA)).sum()

    check(lowered(jax.value_and_grad(total), jax.ShapeDtypeStruct((3,), jnp.float32)), HIT)


@pytest.mark.slow
def test_numba_is_left_out_where_the_default_device_is_no_processor(monkeypatch):
    """On this processor a larger world is searched by a call of Numba's loops, which no GPU has."""
    pytest.importorskip("numba")
    world = tracing.world([tracing.triangles(fan(100))], [tracing.point_light([0, 2, 0], 3.0)])
    scene = tracing.direct_light(world, CAMERA)
    with pytest.raises((ValueError, NotImplementedError), match="callback"):
        lowered(image, scene)
    tables.sizes(monkeypatch, backends.GPU)
    check(lowered(image, scene), HIT)


MEANS = {
    "integrate": lambda: qj.integrate(scenes.disc(), sequences.owen(sequences.sobol(2), 3), 2**14),
    "integrate, replicates": lambda: qj.integrate(
        scenes.disc(), sequences.sobol(2), 2**12, replicates=4, key=3
    ),
    "boundary_gradient": lambda: qj.boundary_gradient(
        scenes.disc(), sequences.owen(sequences.van_der_corput(), 3), 32, 32, 2**12
    ),
}


@pytest.mark.parametrize("name", slow(*MEANS))
def test_means(name):
    text = lowered(MEANS[name])
    # Replicates are summed in float64.
    check(text, "sums of pixels" if lookups(text) else None, fractions="replicates" in name)


ENERGIES = {
    "riesz_energy": analysis.riesz_energy,
    "logarithmic": lambda points: analysis.riesz_energy(points, 0),
    "soft_min_distance": analysis.soft_min_distance,
}


@pytest.mark.parametrize("name", few(ENERGIES, "soft_min_distance"))
def test_energies(name):
    points = jax.ShapeDtypeStruct((COUNT, 2), jnp.float32)
    check(lowered(jax.value_and_grad(ENERGIES[name]), points))


@pytest.fixture
def programs(monkeypatch):
    """Return the list of all programs that run, each lowered for all platforms before it does."""
    texts, call = [], pytrees.Compiled.__call__

    def lowering(self, *args):
        if not any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(args)):
            exported = jax.export.export(self._compiled, platforms=PLATFORMS)(self._classes(args), *args)
            texts.append(exported.mlir_module())
        return call(self, *args)

    monkeypatch.setattr(pytrees.Compiled, "__call__", lowering)
    return texts


def hilbert(spp):
    return samplers.contiguous(orders.hilbert(32, 32), sequences.owen(sequences.sobol(2), 3), spp)


LOOPS = {
    "render": lambda: qj.render(scenes.disc(), hilbert(4), 32, 32, 4),
    "render_adaptive": lambda: qj.render_adaptive(scenes.disc(), hilbert(4), 32, 32, 4),
    "render_passes": lambda: qj.render_passes(
        scenes.disc(),
        samplers.randomized(lambda key: samplers.independent(sequences.sobol(2), key), 3, 4),
        *(32, 32, 2),
    ),
    "pixel_means": lambda: analysis.pixel_means(scenes.disc(), hilbert(4), 32, 32, 4),
}


@pytest.mark.parametrize("name", slow(*LOOPS))
def test_programs_of_loops_on_the_host(programs, name):
    """What Python steers, by the programs that it calls."""
    LOOPS[name]()
    assert programs
    for text in programs:
        check(text)


def test_what_is_looked_for_is_found():
    table = jnp.arange(64, dtype=jnp.uint32)
    index = WORDS

    def called(x):
        return jax.pure_callback(np.asarray, jax.ShapeDtypeStruct(x.shape, x.dtype), x)

    def doubled(x):
        with jax.enable_x64(True):
            return (x.astype(jnp.float64) * 0.5).astype(jnp.float32)

    with pytest.raises((ValueError, NotImplementedError), match="callback"):
        lowered(called, index)
    for wrong in (doubled, lambda x: table[x]):
        with pytest.raises(AssertionError):
            check(lowered(wrong, index))
    check(lowered(lambda x: x * table[3], index))
