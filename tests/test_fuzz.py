"""Wrong arguments in every place of every public function: an error that names one, or a right result.

Each wrong thing goes into the place of each parameter while the others are right, and hypothesis mixes wrong
and right ones in all places at once. What is right is small and always the same, so that little is compiled.
"""

import inspect
import math
import re
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.stats import qmc

import analysis
import qmcjax
from qmcjax import bridges, orders, samplers, scenes, sequences

pytestmark = pytest.mark.slow

EXAMPLES = 60
"""Mixed calls of each function, or fewer if it has fewer."""

CALLS = 20_000
"""At least so many calls with one wrong argument there must be."""

IMAGE = np.array([[0.0, 1.0], [2.0, 5.0]])
POINTS = np.array([[0.0, 0.0], [0.25, 0.5], [0.5, 0.25], [0.75, 0.75]])


@dataclass
class Plain:
    """Neither a sequence nor an order, a sampler or a scene, but with some of their attributes."""

    dims: int = 2
    width: int = 4
    height: int = 4
    needs: tuple = ("x", "y")


def constant(*args):
    return None


def half(points):
    return points[..., 0] / 2


@cache
def nouns():
    """Return one of each kind."""
    sobol = sequences.sobol(2)
    return {
        "sequence": sobol,
        "order": orders.hilbert(4, 4),
        "sampler": samplers.independent(sobol, 1),
        "scene": scenes.checkerboard(),
    }


@cache
def wrong_things():
    """Return what may come in the place of anything. None of it is large: it may be right somewhere."""
    numbers = [-1, 0, 1, 2, 3, 2**33, 2**64, -(2**70), True, False, np.int64(2), np.uint8(3), np.bool_(True)]
    numbers += [0.5, -0.5, 2.0, math.nan, math.inf, -math.inf, 1e300, np.float32(0.25), 1j, jnp.int32(2)]
    texts = ["", "hash", "owen", "sobol", b"bytes", "0.5"]
    arrays = [np.zeros(0), np.zeros((2, 2)), np.zeros((4, 2), np.int32), np.full((2, 2), np.nan), POINTS > 0]
    arrays += [np.array(["a"]), np.array([None]), np.zeros((2, 2), complex), np.zeros((1, 1, 1, 1))]
    arrays += [jnp.ones((3, 2)), jnp.arange(4, dtype=jnp.uint32), jax.random.key(0), jax.random.key(0)[None]]
    plain = [None, (), (1, 2), (0.5, 0.5), ("x", "y"), [[0.1], [0.2, 0.3]], {}, {"a": 1}, {2: 1}, {0.5}]
    plain += [
        object(),
        Plain(),
        Plain,
        int,
        constant,
        lambda: None,
        math,
        Ellipsis,
        slice(2),
        range(3),
        iter(()),
    ]
    plain += [qmc.Sobol(2), qmc.Sobol(2, rng=0).random(4), SimpleNamespace(dims=2), np.float32, "float32"]
    return [*numbers, *texts, *arrays, *plain, *nouns().values()]


@cache
def folder():
    """Return a folder for files."""
    return Path(tempfile.mkdtemp())


@cache
def right_of_functions():
    """Return what is right for a parameter of one function only."""
    noun = nouns()
    return {
        "qmcjax.sequences.function.f": [lambda index: (index[..., None] % 4).astype(jnp.float32) / 4],
        "qmcjax.samplers.function.f": [lambda x, y, sample: jnp.zeros((*sample.shape, 2))],
        "qmcjax.boundary_gradient.scene": [scenes.disc()],
        "qmcjax.estimated_reference.spp": [32],
        "qmcjax.render_passes.sampler": [
            samplers.randomized(lambda key: samplers.independent(noun["sequence"], key), 1, 4)
        ],
        "qmcjax.render_layers.sampler": [samplers.independent(sequences.sobol(3), 1)],
        "qmcjax.sequences.components.dims": [(0, 1)],
        "qmcjax.samplers.as_sampler.value": [noun["sampler"]],
        "qmcjax.samplers.padded_replications.offsets": [sequences.sobol(4)],
        "qmcjax.samplers.randomized.spp": [4],
        "qmcjax.scenes.as_scene.value": [noun["scene"]],
        "qmcjax.scenes.soft_shadow.height": [0.4],
        "qmcjax.orders.as_order.value": [noun["order"]],
        "qmcjax.orders.permutation.image": [np.arange(4).reshape(2, 2)],
        "analysis.squared_min_distance.side": [4],
        "table.errors.sampler": ["a"],
        "table.slope_interval.sampler": ["a"],
        "qmcjax.samplers.contiguous.spp": [4],
        "qmcjax.orders.peano.width": [3, 9],
        "qmcjax.orders.peano.height": [3, 9],
        "qmcjax.sequences.digital.matrices": [np.asarray(sequences.sobol(2).matrices)],
        "qmcjax.sequences.replace_component.matrices": [np.eye(2, dtype=np.int64)[None]],
        "qmcjax.sequences.permutation_net_in_row.index": [1],
        "qmcjax.sequences.faure.base": [2, 3],
        "qmcjax.sequences.kronecker.steps": [[0.25, 0.7]],
        "qmcjax.sequences.record_net.n": [16],
        "analysis.point_spectrum.resolution": [4],
        "analysis.squared_min_distance.points": [[[0, 0], [1, 2]]],
        "analysis.squared_min_distance.shear": [0],
        "analysis.low_frequency_power.image": [np.eye(32)],
        "analysis.low_frequency_power.reference": [np.zeros((32, 32))],
        "analysis.low_frequency_power.cutoff": [0.25],
        "analysis.convergence.reference": [(np.zeros((4, 4)), 0.0), None],
        "analysis.segment_counts.radius": [1],
        "analysis.optimize_points.measure": [analysis.periodic_discrepancy],
        "analysis.optimize_scrambling.points": [[[0, 0], [1, 1]]],
        "analysis.optimize_scrambling.measure": [lambda points: points.sum()],
        "analysis.mean_spectrum.make": [lambda key: np.ones(2)],
        "analysis.search_net.m": [1, 2],
        "analysis.search_discrepancy.start": [None],
        "qmcjax.bridges.tabulate.generator": [SimpleNamespace(random=lambda n: np.zeros((n, 2)))],
        "plain.start.pixel": [(1, 2)],
        "plain.array.dims": [(0, 1)],
        "qmcjax.bridges.bake.dims": [(0, 1)],
        "qmcjax.bridges.bake.tile": [(2, 2)],
        "qmcjax.sequences.direction_numbers.sequence": [sequences.sobol(3)],
        "qmcjax.bridges.bake_ranked.sampler": [samplers.ranked(2, 1)],
        "qmcjax.bridges.write_points.path": [folder() / "points.csv"],
        "qmcjax.bridges.write_image.path": [folder() / "image.png"],
        "qmcjax.bridges.write_image.transfer": ["srgb"],
    }


@cache
def right_of_names():
    """Return what is right for parameters of a name."""
    noun = nouns()
    return {
        "sequence": [noun["sequence"]],
        "net": [sequences.hammersley_net(4)],
        "order": [noun["order"]],
        "sampler": [noun["sampler"]],
        "scene": [noun["scene"]],
        "moving": [scenes.moving_edge()],
        "still": [noun["scene"]],
        "shifts": [noun["sequence"]],
        "offsets": [noun["sequence"]],
        "sampler_of_key": [lambda key: samplers.independent(noun["sequence"], key)],
        "samplers": [{"a": noun["sampler"]}],
        "spps": [[1, 2]],
        "function": [half],
        "f": [half],
        "needs": [("x", "y")],
        "width": [4],
        "height": [4],
        "spp": [4],
        "still_spp": [4],
        "passes": [2],
        "n": [4],
        "m": [2, 4],
        "side": [2],
        "dims": [2],
        "key": [1],
        "start": [0],
        "index": [0, 3],
        "x": [1],
        "y": [2],
        "sample": [0],
        "position": [5],
        "log_side": [1],
        "a": [3],
        "radius": [0.3],
        "iterations": [1],
        "repeats": [1],
        "steps": [1],
        "budget_s": [0.01],
        "seconds": [0.01],
        "regions": [5],
        "points": [POINTS],
        "points_or_matrices": [POINTS],
        "matrices": [np.eye(2, dtype=np.int64)[None]],
        "component": [0],
        "replacement": [np.eye(2, dtype=np.int64)],
        "q": [2],
        "polynomial": [7],
        "initial": [[1, 3]],
        "numbers": [[(7, [1, 3])]],
        "row": [0],
        "image": [IMAGE],
        "images": [[IMAGE, IMAGE]],
        "count": [2],
        "reference": [0 * IMAGE],
        "spectrum": [IMAGE],
        "keys": [(1, 2)],
        "bits": [16],
        "digits": [(1, 1)],
        "targets": [{2: 1}],
        "mask": [np.array([[0.1, 0.6], [0.7, 0.3]])],
        "family": ["gaussian"],
        "value": [noun["sequence"]],
        "name": ["value"],
        "cls": [],
        "dtype": [jnp.float32],
        "level": [0.5],
        "label": ["a"],
        "region": ["whole"],
        "offset_or_key": [1],
    }


def right_things(name, qualified):
    of_function = right_of_functions().get(f"{qualified}.{name}")
    return right_of_names().get(name, []) if of_function is None else of_function


NEVER_OMITTED = {"width", "height", "repeats", "steps", "budget_s", "iterations"}
"""What they are by default would take long."""

LEFT_OUT = {"name", "progress", "checkpoint"}
"""A checkpoint would be left in the folder."""

FUNCTIONS = {"function", "f", "measure", "make", "sampler_of_key", "cls"}
"""Anything that can be called is a function: what goes wrong inside of it is its own matter."""


def modules():
    return (qmcjax, sequences, orders, samplers, scenes, bridges, analysis)


@cache
def targets():
    """Return all public functions by name, and the methods of one noun of each kind."""
    found = {}
    for module in modules():
        for name, value in ((name, getattr(module, name)) for name in dir(module)):
            public = callable(value) and not inspect.isclass(value) and not name.startswith("_")
            if public:
                found[f"{module.__name__}.{name}"] = value
    noun = nouns()
    table = analysis.ConvergenceTable(
        tuple(analysis.ConvergenceRow("a", 4**k, {"whole": 3.0**-k}, 1.0, 1.0) for k in range(4)), 0.0
    )
    found |= {
        "sequence.__call__": noun["sequence"].__call__,
        "sequence.points": noun["sequence"].points,
        "sequence.bits": noun["sequence"].bits,
        "halton.__call__": sequences.halton(2).__call__,
        "halton.points": sequences.halton(2).points,
        "order.position": noun["order"].position,
        "order.pixel": noun["order"].pixel,
        "sampler.__call__": noun["sampler"].__call__,
        "sampler.check": noun["sampler"].check,
        "scene.reference": noun["scene"].reference,
        "table.errors": table.errors,
        "table.slope_interval": table.slope_interval,
        "estimate.interval": qmcjax.Estimate(1.0, 0.1, 5, 0.0).interval,
        "SequenceEngine": bridges.SequenceEngine,
        "PlainSampler": bridges.PlainSampler,
        "plain.start": bridges.PlainSampler(noun["sampler"]).start,
        "plain.array": bridges.PlainSampler(noun["sampler"]).array,
    }
    return found


NAMES = list(targets())


def parameters(qualified):
    return inspect.signature(targets()[qualified]).parameters


def right_call(qualified):
    """Return right arguments, without those that may be left out."""
    arguments = {}
    for name, parameter in parameters(qualified).items():
        right = right_things(name, qualified)
        optional = parameter.default is not parameter.empty
        given = not optional or name in NEVER_OMITTED or qualified == "qmcjax.samplers.randomized"
        if right and given:
            arguments[name] = right[0]
    return arguments


def outcome(qualified, arguments):
    """Call a function; return None, or how it fails other than by an error that names an argument."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = targets()[qualified](**arguments)
            result = list(result) if isinstance(result, Iterator) else result
    except (TypeError, ValueError) as error:
        if any(re.search(rf"(?<![A-Za-z_]){name}\b", str(error)) for name in parameters(qualified)):
            return None
        return f"{type(error).__name__}: {str(error)[:150]}"
    except OSError as error:
        return None if "path" in arguments else f"{type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:150]}"
    arrays = [leaf for leaf in jax.tree.leaves(result) if isinstance(leaf, np.ndarray | jax.Array)]
    known = [np.asarray(a) for a in arrays if not jnp.issubdtype(a.dtype, jax.dtypes.prng_key)]
    undefined = any(a.dtype.kind in "fc" and np.isnan(a).any() for a in known)
    return "a result that is not a number" if undefined and "anisotropy" not in qualified else None


def shown(arguments):
    return ", ".join(f"{name}={qmcjax.core.checks.shown(value)}" for name, value in arguments.items())


def places(qualified):
    return [name for name in parameters(qualified) if name not in LEFT_OUT]


def wrong_for(name):
    return [w for w in wrong_things() if not (name in FUNCTIONS and callable(w) and w is not constant)]


def test_there_are_enough_calls():
    assert sum(len(places(name)) for name in NAMES) * len(wrong_things()) >= CALLS


@pytest.mark.parametrize("qualified", NAMES)
def test_one_wrong_argument(qualified):
    """None of them makes a function end otherwise than it may."""
    failed = []
    for name in places(qualified):
        for wrong in wrong_for(name):
            arguments = {**right_call(qualified), name: wrong}
            found = outcome(qualified, arguments)
            if found is not None:
                failed.append(f"{qualified}({shown(arguments)}): {found}")
    assert not failed, "\n".join([f"{len(failed)} calls", *failed])


@pytest.mark.parametrize("qualified", NAMES)
def test_mixed_arguments(qualified):
    """Right and wrong ones in all places."""

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.data())
    def calls(data):
        arguments = right_call(qualified)
        for name in places(qualified):
            right = right_things(name, qualified)
            wrong = wrong_for(name)
            pool = [*right * (len(wrong) // max(1, len(right))), *wrong]
            if name not in arguments and data.draw(st.booleans()):
                continue
            arguments[name] = data.draw(st.sampled_from(pool))
        assert outcome(qualified, arguments) is None, shown(arguments)

    calls()
