"""Right arguments of every public function, small and always the same, so that little is compiled."""

import inspect
import tempfile
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

import analysis
import qmcjax
from analysis import trees
from figures import plot
from qmcjax import bridges, orders, samplers, scenes, sequences, tracing, warps
from qmcjax.bridges import mitsuba
from qmcjax.tracing import motion

IMAGE = np.array([[0.0, 1.0], [2.0, 5.0]])
POINTS = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]])


def half(points):
    return points[..., 0] / 2


@cache
def nouns():
    """Return one of each kind."""
    sobol = sequences.sobol(2)
    made = {"sampler": samplers.independent(sobol, 1), "scene": scenes.checkerboard()}
    return {"sequence": sobol, "order": orders.hilbert(4, 4), **made}


@cache
def folder():
    """Return a folder for files."""
    return Path(tempfile.mkdtemp())


@cache
def files():
    """Return files that can be read."""
    names = {"points": folder() / "given.csv", "image": folder() / "given.png"}
    names |= {"matrices": folder() / "given.txt", "lattice": folder() / "given_lattice.txt"}
    names["matrices"].write_text(sequences.matrices_text(sequences.sobol(2).matrices))
    names["lattice"].write_text(sequences.lattice_text(sequences.korobov(5, 2, 2)))
    bridges.write_points(names["points"], POINTS)
    bridges.write_image(names["image"], IMAGE / 5, transfer="srgb")
    return names


# fmt: off
@cache
def right_of_functions():
    """Return what is right for a parameter of one function only."""
    noun = nouns()
    passes = samplers.randomized(lambda key: samplers.independent(noun["sequence"], key), 1, 4)
    return right_of_traced() | {
        "tracing.analytic_visibility.samples": [1], "comparison.spp": [4], "comparison.sampler": ["a"],
        "comparison.scene": ["disc"],
        "qmcjax.sequences.function.f": [lambda index: (index[..., None] % 4).astype(jnp.float32) / 4],
        "qmcjax.samplers.function.f": [lambda x, y, sample: jnp.zeros((*sample.shape, 2))],
        "qmcjax.boundary_gradient.scene": [scenes.disc()], "qmcjax.estimated_reference.spp": [32],
        "qmcjax.render_passes.sampler": [passes], "qmcjax.sequences.components.dims": [(0, 1)],
        "qmcjax.samplers.as_sampler.value": [noun["sampler"]],
        "qmcjax.samplers.blue_noise_mask.channels": [1], "qmcjax.samplers.blue_noise_mask.side": [16],
        "qmcjax.samplers.padded_replications.offsets": [sequences.sobol(4)],
        "qmcjax.samplers.randomized.spp": [4], "qmcjax.scenes.as_scene.value": [noun["scene"]],
        "qmcjax.scenes.soft_shadow.height": [0.4], "qmcjax.orders.as_order.value": [noun["order"]],
        "qmcjax.orders.permutation.image": [np.arange(4).reshape(2, 2)],
        "analysis.denoised_error.denoiser": [lambda image, *others: image],
        "analysis.compare.measures": [None, {"trimmed": analysis.trimmed_error}],
        "analysis.relative_error.epsilon": [0.01], "analysis.trimmed_error.share": [0.1],
        "analysis.convergence.keys": [2], "plot.convergence.errors": [{"a": [0.5, 0.25]}],
        "analysis.denoised_error.albedo": [None], "analysis.denoised_error.normal": [None],
        "analysis.expected_error.points": [np.full((4, 4, 1, 2), 0.5)],
        "analysis.expected_error.integrands": ["boxes"], "analysis.expected_error.filters": [1.0],
        "analysis.design_samples.dims": [2], "analysis.design_samples.steps": [20],
        "analysis.design_samples.integrands": ["boxes"], "analysis.design_samples.filters": [1.0],
        "analysis.minimize.loss": [lambda free, key: jnp.sum(free**2)], "analysis.minimize.steps": [20],
        "analysis.minimize.parameters": [np.ones(2, np.float32)], "analysis.minimize.project": [None],
        "analysis.minimize.rate": [0.1], "analysis.minimize.noise": [0.0],
        "analysis.design_samples.frames": [None], "qmcjax.samplers.designed.frames": [None],
        "qmcjax.samplers.tiled.points": [np.full((4, 4, 1, 2), 0.5)],
        "analysis.soft_star_discrepancy.temperature": [0.1], "analysis.squared_min_distance.side": [4],
        "table.sampler": ["a"], "row.measure": ["RMS error"], "scrambling.code": [1],
        "scrambling.digits": [2], "z.rounds": [2], "z.counts": [np.ones((4, 4), int)],
        "analysis.compare.scenes": [{"disc": scenes.disc()}], "analysis.compare.width": [32],
        "analysis.compare.height": [32], "analysis.compare.keys": [1], "analysis.compare.spps": [[1]],
        "analysis.t_value.points_or_matrices": [np.stack([np.eye(2, dtype=int)] * 2)],
        "analysis.t_value.m": [2],
        "analysis.projection_t_values.points_or_matrices": [np.stack([np.eye(2, dtype=int)] * 2)],
        "analysis.projection_t_values.m": [2], "analysis.read_points.path": [files()["points"]],
        "qmcjax.bridges.read_points.path": [files()["points"]],
        "qmcjax.bridges.read_image.path": [files()["image"]], "qmcjax.bridges.read_image.transfer": ["srgb"],
        "qmcjax.bridges.read_image.layer": [None],
        "qmcjax.sequences.read_direction_numbers.path": [Path(__file__).parent / "direction_numbers.txt"],
        "qmcjax.warps.triangle.vertices": [[[0, 0], [1, 0], [0, 1]]],
        "qmcjax.warps.discrete.weights": [[1, 2]], "warp.discrete.points": [[[0.5]]],
        "warp.discrete.values": [[0, 2]], "warp.normal.values": [POINTS],
        "qmcjax.sequences.read_matrices.path": [files()["matrices"]],
        "qmcjax.bridges.read_mask.path": [files()["image"]],
        "qmcjax.sequences.read_lattice.path": [files()["lattice"]], "qmcjax.sequences.read_lattice.n": [5],
        "qmcjax.sequences.matrices_text.matrices": [np.asarray(sequences.sobol(2).matrices)],
        "qmcjax.sequences.lattice_text.lattice": [sequences.korobov(5, 2, 2)],
        "qmcjax.samplers.contiguous.spp": [4], "qmcjax.orders.peano.width": [3, 9],
        "qmcjax.orders.peano.height": [3, 9],
        "qmcjax.sequences.digital.matrices": [np.asarray(sequences.sobol(2).matrices)],
        "qmcjax.sequences.permutation_net_in_row.index": [1], "qmcjax.sequences.faure.base": [2, 3],
        "qmcjax.sequences.poisson_disk.sides": [(1, 2)], "qmcjax.sequences.kronecker.steps": [[0.25, 0.7]],
        "qmcjax.sequences.record_net.n": [16],
        "qmcjax.sequences.record_net.discrepancy": ["star", "periodic"],
        "analysis.window_discrepancy.values": [np.full((8, 5, 5), 0.5)],
        "analysis.point_spectrum.resolution": [4], "analysis.squared_min_distance.points": [[[0, 0], [1, 2]]],
        "analysis.squared_min_distance.shear": [0], "analysis.low_frequency_power.image": [np.eye(32)],
        "analysis.low_frequency_power.reference": [np.zeros((32, 32))],
        "analysis.low_frequency_power.cutoff": [0.25],
        "analysis.convergence.reference": [(np.zeros((4, 4)), 0.0), None],
        "analysis.segment_counts.radius": [1],
        "analysis.optimize_points.measure": [analysis.periodic_discrepancy],
        "analysis.optimize_scrambling.points": [[[0, 0], [1, 1]]],
        "analysis.optimize_scrambling.measure": [lambda points: points.sum()],
        "analysis.mean_spectrum.make": [lambda key: np.ones(2)], "analysis.search_net.m": [1, 2],
        "analysis.search_discrepancy.start": [None],
        "qmcjax.bridges.tabulate.generator": [SimpleNamespace(random=lambda n: np.zeros((n, 2)))],
        "plain.start.pixel": [(1, 2)], "plain.array.dims": [(0, 1)], "qmcjax.bridges.bake.dims": [(0, 1)],
        "qmcjax.bridges.seeds.other": [nouns()["sampler"]], "qmcjax.bridges.bake.tile": [(2, 2)],
        "qmcjax.bridges.source.dims": [(0, 1)],
        "qmcjax.sequences.direction_numbers.sequence": [sequences.sobol(3)],
        "qmcjax.bridges.write_points.path": [folder() / "points.csv"],
        "qmcjax.bridges.write_image.path": [folder() / "image.png"],
        "qmcjax.bridges.write_image.transfer": ["srgb"], "mitsuba.register.variant": ["scalar_rgb"],
    } | ({f"mitsuba.{name}.scene": [loaded()] for name in RENDERS} if MITSUBA else {})
# fmt: on


@cache
def traced():
    """Return a world with one of each kind, a camera and what is made of them."""
    ball = tracing.sphere([0, 0, 0], 1.0)
    world = tracing.world([ball], [tracing.point_light([4, 4, 4], 50.0)])
    camera = tracing.camera([0, 0, 5], [0, 0, 0], shutter=0.5)
    fall = motion.affine(None, motion.linear_segments([0, 1], [[0, 2, 5], [0, -2, 5]]))
    falling = tracing.world([tracing.sphere([0, 0, 0], 1.0, motion=fall)], [tracing.environment(1.0)])
    still = tracing.direct_light(world, camera)
    moving = tracing.direct_light(falling, tracing.camera([0, 0, 5], [0, 0, 0]))
    tree = trees.surface_area_tree(BOXES, BOXES + 1)
    low = np.stack([BOXES, BOXES])
    corners = np.stack([low, low + 1, low * 2 + [1, 0, 0]], axis=2)
    return SimpleNamespace(**locals())


BOXES = np.arange(12.0).reshape(4, 3)
TIMES = [0.0, 1.0]
QUATERNION = [0.0, 0.0, 0.6, 0.8]


# fmt: off
def right_of_traced():
    """Return what is right for functions of rays, motions and plots."""
    of = traced()
    vector, corners = [0.0, 0.0, 1.0], [np.eye(3)]
    right = {
        "tracing": {
            "world": of.world, "camera": of.camera, "origin": [0.0, 0, 5],
            "direction": [0.0, 0, -1], "bounces": 0, "low": [0, 0, 0], "high": [1, 1, 1], "position": vector,
            "target": [1, 0, 0], "one": 0.5, "other": 0.2, "base": vector, "axis": vector, "color": 0.5,
            "center": vector, "point": vector, "normal": vector, "radiance": 1.0, "roughness": 0.5,
            "parts": [tracing.plane(vector, vector)], "intensity": 1.0,
            "corner": vector, "edge_u": [1, 0, 0], "edge_v": [0, 1, 0], "vertices": corners,
            "objects": [tracing.sphere(vector, 1.0)], "candidates": 4,
        },
        "tracing.analytic_visibility": {"scene": of.moving},
        "motion": {
            "curve": lambda t: jnp.stack([t, t], axis=-1), "start": 0.0, "end": 1.0, "segments": 4,
            "translation": vector, "q": QUATERNION,
            "a": QUATERNION, "b": QUATERNION, "t": 0.5, "times": TIMES, "vector": vector, "axis": vector,
            "angle": 0.5, "motion": of.fall, "keys": [QUATERNION, QUATERNION], "control": POINTS[:3],
            "weights": [1, 1, 1], "knots": [0, 0, 0, 1, 1, 1], "degree": 2,
        },
        "motion.affine": {"matrix": np.eye(3)},
        "motion.linear_segments": {"points": BOXES[:2]},
        "motion.rotation_box": {"points": BOXES},
        "trees": {
            "low": BOXES, "high": BOXES + 1, "tree": of.tree, "origin": [[0.0, 0, 0]], "direction": [vector],
            "vertices": np.stack([BOXES, BOXES + 1, BOXES * 2 + [1, 0, 0]], axis=1), "times": TIMES,
        },
        "trees.boxes_during": {"low": of.low, "high": of.low + 1, "start": 0.0, "end": 1.0},
        "trees.split_in_time": {"low": of.low, "high": of.low + 1},
        "trees.refitted": {"low": of.low, "high": of.low + 1, "times": TIMES},
        "trees.triangle_distances": {"vertices": of.corners, "times": TIMES, "time": [0.5]},
        "plot": {
            "spps": [1, 4], "image": IMAGE, "reference": 0 * IMAGE,
            "figure": Figure(), "left": 1, "bottom": 1, "zoom": 1, "spectra": np.ones((4, 4)),
            "linear": IMAGE / 5, "name": "Z", "points": POINTS,
        },
        "camera": {"x": 0.5, "y": 0.5, "time": 0.5, "lens": ()},
        "pattern": {"u": 0.5, "v": 0.5, "time": 0.5},
        "path": {"time": 0.5, "u": 0.5, "part": 0.5, "segments": 4, "low": [0, 0, 0], "high": [1, 1, 1]},
        "disc": {"point": [0.5, 0.5], "low": [0.1, 0.1], "high": [0.2, 0.2], "u": [0.5]},
        "moving": {"point": [0.5] * 5, "low": [0.1] * 5, "high": [0.2] * 5},
        "estimator": {"point": [0.5, 0.5], "low": [0.1, 0.1], "high": [0.2, 0.2]},
        "engine": {"n": 2},
        "z.split": {"dims": (0, 1)},
        "choice": {"width": 4, "height": 4},
    }
    return {f"{place}.{name}": [value] for place, values in right.items() for name, value in values.items()}
# fmt: on


# fmt: off
@cache
def right_of_names():
    """Return what is right for parameters of a name."""
    noun = nouns()
    return {
        "sequence": [noun["sequence"]], "net": [sequences.hammersley_net(4)], "order": [noun["order"]],
        "sampler": [noun["sampler"]], "scene": [noun["scene"]], "shifts": [noun["sequence"]],
        "offsets": [noun["sequence"]],
        "sampler_of_key": [lambda key: samplers.independent(noun["sequence"], key)],
        "samplers": [{"a": noun["sampler"]}], "spps": [[1, 2]], "function": [half], "f": [half],
        "needs": [("x", "y")], "width": [4], "height": [4], "spp": [4], "passes": [2], "n": [4], "m": [2, 4],
        "side": [2], "dims": [2], "key": [1], "start": [0], "index": [0, 3], "x": [1], "y": [2],
        "sample": [0], "position": [5], "log_side": [1], "a": [3], "radius": [0.3], "iterations": [1],
        "repeats": [1], "steps": [1], "budget_s": [0.01], "seconds": [0.01], "regions": [5],
        "points": [POINTS], "points_or_matrices": [POINTS], "matrices": [np.eye(2, dtype=np.int64)[None]],
        "component": [0], "replacement": [np.eye(2, dtype=np.int64)], "q": [2], "numbers": [[(7, [1, 3])]],
        "row": [0], "image": [IMAGE], "images": [[IMAGE, IMAGE]], "count": [2], "reference": [0 * IMAGE],
        "spectrum": [IMAGE], "keys": [(1, 2)], "bits": [16], "digits": [(1, 1)], "targets": [{2: 1}],
        "frames": [4], "frame": [1], "alpha": [0.5], "t": [1], "mask": [np.array([[0.1, 0.6], [0.7, 0.3]])],
        "family": ["gaussian"], "value": [noun["sequence"]], "values": [[[0.0, 0.0, 1.0]]], "name": ["value"],
        "cls": [], "dtype": [jnp.float32], "level": [0.5], "label": ["a"], "region": ["whole"],
        "offset_or_key": [1],
    }
# fmt: on


def right_things(name, qualified):
    """Return those of the nearest place that has any: a function, its module or object, all."""
    parts, known = qualified.split("."), right_of_functions()
    places = (".".join([*parts[:k], name]) for k in range(len(parts), 0, -1))
    return next((known[place] for place in places if place in known), right_of_names().get(name, []))


NEVER_OMITTED = {"width", "height", "repeats", "steps", "budget_s", "iterations"}
"""What they are by default would take long. What is right for one function is given, too."""

LEFT_OUT = {"progress", "checkpoint", "style"}
"""A checkpoint would be left in the folder; what a style may be is matplotlib's."""

# fmt: off
FUNCTIONS = {
    "function", "f", "measure", "make", "sampler_of_key", "cls", "curve", "motion", "translation", "matrix",
    "cost", "denoiser",
}
# fmt: on
"""Anything that can be called is a function: what goes wrong inside of it is its own matter."""


MITSUBA = (mitsuba,) if find_spec("mitsuba") else ()

RENDERS = "render", "sensor_with"


def modules():
    of_qmcjax = (qmcjax, sequences, orders, warps, samplers, scenes, bridges, tracing, motion, *MITSUBA)
    return (*of_qmcjax, analysis, trees, plot)


SHORT = {"qmcjax.tracing": "tracing", "qmcjax.tracing.motion": "motion", "analysis.trees": "trees"}
SHORT |= {"figures.plot": "plot", "qmcjax.bridges.mitsuba": "mitsuba"}


@cache
def functions():
    """Return all public functions by name."""
    return {
        f"{SHORT.get(module.__name__, module.__name__)}.{name}": value
        for module in modules()
        for name, value in ((name, getattr(module, name)) for name in dir(module))
        if callable(value) and not inspect.isclass(value) and not name.startswith("_")
        if value is not analysis.flip or find_spec("flip_evaluator")
        if value is not mitsuba.check_llvm  # It takes no argument, and renders in another process.
    }


def table():
    rows = (analysis.ConvergenceRow("a", 4**k, {"whole": 3.0**-k}, 1.0, 1.0) for k in range(4))
    return analysis.ConvergenceTable(tuple(rows), 0.0)


def row():
    return analysis.ComparisonRow("disc", "a", 4, {"RMS error": (1.0,) * 4}, 0.0, IMAGE, IMAGE, IMAGE)


def curve():
    return motion.nurbs(POINTS[:3], None, [0, 0, 0, 1, 1, 1], 2)


@cache
def renderer():
    """Return Mitsuba in the variant that is tried."""
    mitsuba.register("scalar_rgb")
    import mitsuba as found

    return found


@cache
def film():
    return renderer().load_dict({"type": "hdrfilm", "width": 4, "height": 4})


@cache
def loaded():
    sensor = {"type": "perspective", "film": film()}
    return renderer().load_dict({"type": "scene", "sensor": sensor, "integrator": {"type": "path"}})


def plug_in():
    """Return a sampler of ours that Mitsuba has made."""
    wrapped = mitsuba.wrap(nouns()["sampler"])
    return renderer().load_dict({"type": "qmcjax", "sampler": wrapped, "film": film()})


OBJECTS = {
    "sequence": (lambda: nouns()["sequence"], "__call__ points bits"),
    "halton": (lambda: sequences.halton(2), "__call__ points"),
    "order": (lambda: nouns()["order"], "position pixel"),
    "sampler": (lambda: nouns()["sampler"], "__call__ check"),
    "scene": (lambda: nouns()["scene"], "reference"),
    "table": (table, "errors slope slope_interval efficiency bands"),
    "table.row": (lambda: table().rows[0], "interval"),
    "estimate": (lambda: qmcjax.Estimate(1.0, 0.1, 0.0, np.ones(5), 0.0, 0.0, 0.0, 5, 8), "interval"),
    "plain": (lambda: bridges.PlainSampler(nouns()["sampler"]), "start array"),
    "engine": (lambda: bridges.SequenceEngine(nouns()["sequence"]), "random fast_forward"),
    "made": (lambda: bridges, "SequenceEngine PlainSampler"),
    "comparison": (
        lambda: analysis.Comparison((row(), replace(row(), spp=16)), {"a": {}}, {}, {}, {}),
        "row errors slope ranks",
    ),
    "row": (row, "mean interval"),
    "camera": (lambda: traced().camera, "times view rays"),
    "pattern.checker": (lambda: tracing.checker(0.5, 0.2), "__call__"),
    "pattern.stripes": (lambda: tracing.stripes(0.5, 0.2), "__call__"),
    "path.affine": (lambda: traced().fall, "__call__ reach"),
    "path.lines": (lambda: motion.linear_segments(TIMES, BOXES[:2]), "__call__"),
    "path.rotations": (lambda: motion.rotation_spline(TIMES, [QUATERNION] * 2), "__call__"),
    "path.straightened": (lambda: motion.straightened(traced().fall, TIMES), "__call__"),
    "path.nurbs": (curve, "__call__ by_arc_length"),
    "path.arc": (lambda: curve().by_arc_length(4), "__call__"),
    "disc": (scenes.disc, "__call__ varies boundary reference"),
    "disc.function": (lambda: scenes.function(half, ("x", "y")), "__call__"),
    "estimator": (lambda: traced().still, "__call__ varies"),
    "moving": (lambda: traced().moving, "__call__ varies"),
    "moving.analytic": (lambda: tracing.analytic_visibility(traced().moving), "__call__ varies unresolved"),
    "choice": (lambda: qmcjax.recommend(2, 4), "sampler"),
    "warp.normal": (lambda: warps.normal(2), "__call__ inverse density"),
    "warp.triangle": (lambda: warps.triangle([[0, 0, 1], [1, 0, 0], [0, 1, 0]]), "__call__ inverse density"),
    "warp.hemisphere": (warps.hemisphere, "__call__ inverse density"),
    "warp.simplex": (lambda: warps.simplex(2), "__call__ inverse density"),
    "warp.discrete": (lambda: warps.discrete([1, 0, 3]), "__call__ inverse density"),
    "scrambling": (lambda: orders.scrambled_morton(4, 4, 1), "scrambled"),
    "z": (lambda: samplers.z(4, 4, 4, 1, frames=4), "extended adaptive at_frame split"),
    "frames.order": (lambda: orders.morton3(4, 4, 4, 1), "position pixel at_frame"),
    "frames.curve": (lambda: orders.hilbert3(4, 4, 4), "position pixel at_frame"),
    "frames.sequence": (lambda: sequences.in_time(nouns()["sequence"]), "at_frame"),
    **({"plug_in": (plug_in, "seek")} if MITSUBA else {}),
}
"""What functions return, and methods of it."""

NAMES = [
    *functions(),
    *(f"{k}.{method}" for k, (_, methods) in OBJECTS.items() for method in methods.split()),
]


@cache
def made(name):
    return OBJECTS[name][0]()


@cache
def target(qualified):
    name, _, method = qualified.rpartition(".")
    return getattr(made(name), method) if name in OBJECTS else functions()[qualified]


def parameters(qualified):
    return inspect.signature(target(qualified)).parameters


def right_call(qualified):
    """Return right arguments, without those that may be left out."""
    arguments = {}
    for name, parameter in parameters(qualified).items():
        right = right_things(name, qualified)
        optional = parameter.default is not parameter.empty
        own = f"{qualified}.{name}" in right_of_functions()
        if right and (own or not optional or name in NEVER_OMITTED):
            arguments[name] = right[0]
    return arguments
