"""Programs for GPUs and TPUs, lowered on a processor: what is in them that would be slow or wrong there."""

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
from tables import KINDS, ORDERS, SAMPLERS, SEQUENCES, few

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences, tracing
from qmcjax.core import backends, pytrees

PLATFORMS = ("cuda", "rocm", "tpu")

COUNT = 1024
"""Samples: what is gathered for fewer is no cost of a sample."""

WORDS = jax.ShapeDtypeStruct((COUNT,), jnp.uint32)

TABLES = (
    "halton, *; owen(halton*; digit_scramble(*; full_screen, halton, random; partitioned, *; "
    "shifted, hilbert, lattice; owen_exact(faure*; faure(10); faure(5, modified); quad_optimized(*; "
    "art_owen(*; z, tree; scrambled_morton, tree; full_screen, art; lloyd(*; net_by_net(*; pmj02(*; "
    "optimized; progressive*; dither, *; ranked; designed; tiled, *; z, plain, counts"
).split("; ")
"""Objects, by patterns of their names, that look things up for each sample: permutations and matrices of
digits, random trees, points and orders found by search, masks, ranks, tiles, and the user's counts."""

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


def of_sequence(name):
    sequence = SEQUENCES[name]
    n = min(COUNT, sequence.size or COUNT)
    return lambda sequence, index: (sequence(index), sequence.points(n)), sequence, WORDS


def of_order(name):
    order = ORDERS[name](32, 32)
    return lambda order, x: (order.position(x, x), order.pixel(x)), order, WORDS


def of_sampler(name):
    sampler = SAMPLERS[name]
    dims = tuple(range(sampler.dims))
    return lambda sampler, x: sampler(x, x, x, dims, jnp.float32), sampler, WORDS


def of_image(name):
    """Return what takes samples in batches: another program, with its tables."""
    sampler = SAMPLERS[name]
    spp = min(getattr(sampler, "spp", 4), 4)
    scene = scenes.function(lambda point: point.sum(axis=-1), tuple("xyuvw"[: sampler.dims]))
    return lambda sampler: qj.render(scene, sampler, 32, 32, spp), sampler


IMAGES = "contiguous, hilbert, sobol", "contiguous, raster, halton", "z, hash", "optimized", "ranked"
OBJECTS = {
    "sequence": (of_sequence, (*KINDS, "halton(3)", "korobov(2000)", "quad_optimized(6)")),
    **{"order": (of_order, ORDERS), "sampler": (of_sampler, SAMPLERS), "image": (of_image, IMAGES)},
}
OF_OBJECTS = {f"{kind}: {name}": (make, name) for kind, (make, names) in OBJECTS.items() for name in names}


QUICK = """sequence: owen(sobol(2)); sequence: halton(3); sequence: permutation_net_3d(11); order: hilbert;
    sampler: z, hash; sampler: full_screen, halton, random; image: contiguous, hilbert, sobol""".split(";")


@pytest.mark.parametrize("case", few(OF_OBJECTS, *map(str.strip, QUICK)))
def test_objects(case):
    make, name = OF_OBJECTS[case]
    function, *arguments = make(name)
    check(lowered(function, *arguments), listed(name, TABLES), listed(name, FRACTIONS) is not None)


@pytest.mark.slow
def test_images_on_two_devices():
    """Spread over a mesh: what the devices tell each other is not told by the host."""
    mesh = jax.make_mesh((2,), ("device",), axis_types=(AxisType.Auto,))
    sampler = SAMPLERS["contiguous, hilbert, sobol"]
    text = lowered(lambda sampler: qj.render(scenes.disc(), sampler, 32, 32, 4, mesh=mesh), sampler)
    assert "mhlo.num_partitions = 2" in text
    check(text)


PLAIN = """checkerboard zone_plate disc triangle gaussian ramp step line staircase heaviside product
    flat_checkerboard moving_edge defocused_edge soft_shadow blinking_disc ball"""
SCENES = {name: getattr(scenes, name) for name in PLAIN.split()} | {"path_toy": partial(scenes.path_toy, 2)}
SCENES |= {f"genz, {name}": partial(scenes.genz, name, 3) for name in ("oscillatory", "corner_peak")}


def image(scene):
    sampler = samplers.independent(sequences.sobol(len(scene.needs)), key=3)
    return qj.render(scene, sampler, 32, 32, 1)


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
CHECKED, GLOSSY = tracing.diffuse(tracing.checker(0.7, 0.2)), tracing.glossy(0.04, 0.2, [0.6, 0.1, 0.1])
MATERIALS = CHECKED, GLOSSY, tracing.mirror(0.9)
TRACED = {
    "direct_light": lambda: tracing.direct_light(lit(MATERIALS[:2], 3), CAMERA),
    "path_tracing": lambda: tracing.path_tracing(lit(MATERIALS), CAMERA, bounces=2),
    "bidirectional": lambda: tracing.bidirectional(lit(MATERIALS), CAMERA, bounces=1),
}


def brightness(colour):
    matter = tracing.diffuse(colour)
    return image(tracing.direct_light(lit((matter, matter)), CAMERA)).sum()


CLOUD = jax.ShapeDtypeStruct((COUNT, 2), jnp.float32)
CORPUT, SOBOL = sequences.owen(sequences.van_der_corput(), 3), sequences.sobol(2)
ENERGIES = {name: getattr(analysis, name) for name in ("riesz_energy", "soft_min_distance")}
ENERGIES["logarithmic"] = lambda points: analysis.riesz_energy(points, 0)
DERIVED = "zone_plate", "gaussian", "genz, oscillatory"
PROGRAMS = {
    **{name: lambda make=make: (image, make()) for name, make in SCENES.items()},
    **{f"derivative, {k}": lambda k=k: (jax.grad(lambda s: image(s).sum()), SCENES[k]()) for k in DERIVED},
    **{f"traced, {name}": lambda make=make: (image, make()) for name, make in TRACED.items()},
    "traced, derivative": lambda: (jax.value_and_grad(brightness), jax.ShapeDtypeStruct((3,), jnp.float32)),
    **{name: lambda energy=energy: (jax.value_and_grad(energy), CLOUD) for name, energy in ENERGIES.items()},
    "integrate": lambda: (lambda: qj.integrate(scenes.disc(), sequences.owen(SOBOL, 3), 2**14),),
    "replicates": lambda: (lambda: qj.integrate(scenes.disc(), SOBOL, 2**12, replicates=4, key=3),),
    "boundary_gradient": lambda: (partial(qj.boundary_gradient, scenes.disc(), CORPUT, 32, 32, 2**12),),
}
LOOKED_UP = {name: HIT for name in PROGRAMS if name.startswith("traced")}
LOOKED_UP["boundary_gradient"] = "sums of pixels"


@pytest.mark.parametrize("name", few(PROGRAMS, "disc", "soft_min_distance"))
def test_programs(monkeypatch, name):
    """Traced scenes as where the default device is no processor: without Numba's loops and tiles."""
    if name.startswith("traced"):
        tables.sizes(monkeypatch, backends.GPU)
    function, *arguments = PROGRAMS[name]()
    # Replicates are summed in float64.
    check(lowered(function, *arguments), LOOKED_UP.get(name), name == "replicates")


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


HILBERT = samplers.contiguous(orders.hilbert(32, 32), sequences.owen(SOBOL, 3), 4)


LOOPS = {each.__name__: (each, HILBERT) for each in (qj.render, qj.render_adaptive, analysis.pixel_means)}
LOOPS["render_passes"] = qj.render_passes, samplers.randomized(partial(samplers.independent, SOBOL), 3, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_programs_of_loops_on_the_host(programs, name):
    """What Python steers, by the programs that it calls."""
    call, sampler = LOOPS[name]
    call(scenes.disc(), sampler, 32, 32, 4)
    assert programs
    for text in programs:
        check(text)
