"""Wrong arguments in every place of every public function: an error that names it, or a right result.

Wrong arguments are made from what the docstrings say of a parameter: other types, and values beside the ends
of its range. Those of ``wrong.py`` are wrong for other reasons. On request, anything goes into each place.
"""

import inspect
import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from arguments import FUNCTIONS, LEFT_OUT, NAMES, POINTS, nouns, parameters, right_call, target
from scipy.stats import qmc
from tables import known, some
from wrong import TYPES, VALUES

import qmcjax
from qmcjax import orders, samplers, sequences

pytestmark = pytest.mark.usefixtures("least_optimized")

CALLS = 1500
"""At least so many wrong arguments must come from docstrings."""


@dataclass
class Plain:
    """Neither a sequence nor an order, a sampler or a scene, but with some of their attributes."""

    dims: int = 2
    width: int = 4
    height: int = 4
    needs: tuple = ("x", "y")


def constant(*args):
    return None


@cache
def nowhere_right():
    return [object(), Plain, np.full((2, 2), 1j), {2: 1}]


# fmt: off
@cache
def few_wrong_things():
    """Return what is hardly ever right."""
    plain = [None, "", math.nan, -1, 0.5, True, np.zeros(0), (), [[0.1], [0.2, 0.3]]]
    return [*nowhere_right(), *plain, nouns()["order"]]
# fmt: on


class Kind(NamedTuple):
    documented: str
    """How the description of such parameters begins, a regular expression."""
    types: tuple = ()
    """Arguments of which each is a TypeError."""
    values: tuple = ()
    """Arguments of which each is a ValueError."""


@cache
def kinds():
    """Return what is wrong for parameters of a kind."""
    words, halton = POINTS.astype(np.uint32), sequences.halton(2)
    return [
        Kind(r"int(,|$| )(?!or)", (0.5, "4")),
        Kind(r"float(,|$)", ("a", 1j), (math.nan,)),
        Kind(r"(int|float)\b.*\bpositive", (), (0, -1)),
        Kind(r"bool", (1, "yes")),
        Kind(r"callable", (3,)),
        Kind(r"path|str", (3,)),
        Kind(r"\{.*\"", (), ("other",)),
        Kind(r"float32 or float64(?! Array)", (), (jnp.int32, np.float16)),
        Kind(r"jax\.random\.key, or int", ("seed", 0.5), (-1, 2**32, key_of_another_generator())),
        Kind(r"(BinarySequence|sequence in base 2(?!, or)|Digital$)", (3, halton)),
        Kind(r"sequence in base 2, or Halton, ", (3, sequences.rotate(halton, [0.5, 0.5]))),
        Kind(r"(Sequence|Order|Sampler|Scene|World|Camera|Tree)\b(?!.*\bor )", (3, "x")),
        Kind(r"(float|int|integer|uint32|real|array_like).*(Array|array)", ("abc",)),
        Kind(r"float (ArrayLike|array), shape (?!\(\.\.\.(, 1)?\))", (), (math.nan, np.full((1,) * 7, 0.5))),
        Kind(
            r"float ArrayLike, shape \(n, d\)",
            (words, POINTS > 0, None),
            (POINTS - 1, POINTS + 1, POINTS[:0]),
        ),
    ]


RANGE = re.compile(r"\b[Ii]n \[([-\d.*]+), ([-\d.*]+)([\])])")


def beside_the_range(text):
    """Return integers, or floats, just outside of the documented range."""
    if not re.match(r"(int|float)\b(?!.*Array)", text):
        return []
    if found := RANGE.search(text):
        low, high = eval(found[1]), eval(found[2])
        return [low - 1, high + (found[3] == "]")]
    if found := re.match(r"[^.]*\bat least (\d+)", text):
        return [int(found[1]) - 1]
    return [1, 5] if re.match("int, 2(, 3)? or [34]", text) else []


def descriptions(qualified):
    """Return what the docstring says of each parameter, in one line."""
    doc = inspect.getdoc(target(qualified)) or ""
    part = re.split(r"\n\n\w[\w ]*\n-{3,}", doc.partition("Parameters\n----------\n")[2])[0]
    found = re.finditer(r"^(\w[\w, ]*?) : (.*(?:\n .*|\n(?= ))*)", part, re.M)
    return {name: re.sub(r"\s+", " ", m[2]) for m in found for name in m[1].split(", ")}


def generated():
    """Return wrong arguments as docstrings have them: function, parameter, argument, error."""
    for qualified in NAMES:
        texts = descriptions(qualified)
        for name in places(qualified):
            text = texts.get(name, "")
            for value in beside_the_range(text):
                yield qualified, name, value, ValueError
            for kind in kinds():
                if re.match(kind.documented, text):
                    yield from ((qualified, name, value, TypeError) for value in kind.types)
                    yield from ((qualified, name, value, ValueError) for value in kind.values)


RIGHT_THERE = {
    "made.SequenceEngine.seed", "trees.nodes_visited.time", "analysis.read_points.which",
    "qmcjax.bridges.read_points.which", "analysis.riesz_energy.points",
    "qmcjax.sequences.poisson_disk.radius",
}  # fmt: skip
"""Where some generated arguments are right, or the error begins with the name of the file."""


def places(qualified):
    left_out = LEFT_OUT | ({"name"} if ".as_" in qualified else set())  # By what it calls its argument.
    return [name for name in parameters(qualified) if name not in left_out]


def wrong_end(qualified, name, wrong, error):
    """Return None, or how a call ends otherwise than by such an error that begins with the argument."""
    try:
        result = target(qualified)(**{**right_call(qualified), name: wrong})
        found = list(result) if isinstance(result, Iterator) else result
    except Exception as raised:
        found = raised
        # Arguments that exclude each other are wrong values, whatever their type.
        depends = re.search(r" must be (None without|given for) ", f"{raised} ")
        if (type(raised) is error or depends) and is_named(name, str(raised)):
            return None
    return f"{qualified}: {name}={qmcjax.core.checks.shown(wrong)}: {found!r:.150}"


def test_what_docstrings_exclude_is_named():
    """A wrong type is a TypeError, a wrong value a ValueError, and both begin with the argument."""
    rows = [row for row in generated() if f"{row[0]}.{row[1]}" not in RIGHT_THERE]
    assert len(rows) >= CALLS
    failed = [end for row in rows if (end := wrong_end(*row))]
    assert not failed, "\n".join(failed)


@pytest.mark.parametrize(("error", "table"), [(ValueError, VALUES), (TypeError, TYPES)])
def test_what_else_is_wrong_is_named(error, table):
    rows = [(q, name, wrong, error) for q, of in table.items() for name, all in of.items() for wrong in all]
    failed = [end for row in rows if (end := wrong_end(*row))]
    assert not failed, "\n".join(failed)


SOBOL, NET = sequences.sobol(3), sequences.hammersley_net(5)
MESSAGES = {
    "index must be integers in [0, 31], got 39": lambda: NET.bits(np.arange(40)),
    "start + n must be at most 32 for hammersley_net(m=5), got 5 + 30": lambda: NET.points(30, start=5),
    "dims must name at least one": lambda: SOBOL(0, dims=()),
    "side**dims must be at most 2**32, got side=65536, dims=3": lambda: sequences.jittered(65536, 3, 0),
    "net's m must be at least 8 for one point in each of 16 x 16 cells, got m=7": lambda: (
        sequences.optimized_net(7).points_per_cell(4)
    ),
    "key must be given for permutation='random' only, got None": lambda: sequences.halton(2, "random"),
    "sequence must be a sequence in base 2 (one that has .bits), got halton(dims=2": lambda: sequences.gray(
        sequences.halton(2)
    ),
    "sequence must be a sequence with digits, either in base 2": lambda: sequences.owen(
        sequences.owen(sequences.halton(2), 1), 1
    ),
    "sequence must be a sequence (have dims and a call (index, dims, dtype) or (index)": lambda: (
        sequences.rotate(orders.hilbert(4, 4), 1)
    ),
    "sampler must be a sampler (dims, and either a call on (x, y, sample, dims[, dtype]) or": lambda: (
        samplers.as_sampler("sampler", SOBOL)
    ),
}
"""What errors say: the argument, what it must be, and what came."""


@pytest.mark.parametrize("message", MESSAGES)
def test_messages(message):
    with pytest.raises((TypeError, ValueError)) as raised:
        MESSAGES[message]()
    assert str(raised.value).startswith(message)


# fmt: off
LONG = {
    "analysis.search_discrepancy", "analysis.compare", "analysis.broken_promises", "analysis.pixel_means",
    "analysis.design_samples", "analysis.minimize",
    "analysis.optimize_scrambling", "analysis.optimize_points",
    "qmcjax.render_adaptive", "qmcjax.boundary_gradient", "qmcjax.estimated_reference",
    "tracing.visible_intervals", "tracing.nearest_hit",
    "motion.slerp", "path.rotations.__call__", "estimator.__call__", "estimator.varies", "moving.__call__",
    "moving.analytic.__call__", "moving.varies", "moving.analytic.varies",
    "moving.analytic.unresolved",
}
# fmt: on
"""Programs of many operations, which are compiled for each shape: less is tried."""


@cache
def key_of_another_generator():
    """Return a key of a generator that JAX does not know."""
    from jax.extend.random import define_prng_impl

    def zeros(*shape):
        return jnp.zeros(shape, jnp.uint32)

    made = dict(seed=lambda seed: zeros(3), split=lambda key, shape: zeros(*shape, 3))
    made |= dict(random_bits=lambda key, width, shape: zeros(*shape), fold_in=lambda key, data: key)
    own = define_prng_impl(key_shape=(3,), name="own", tag="own", **made)
    return jax.random.wrap_key_data(np.zeros(3, np.uint32), impl=own)


TAKING = {
    f"{qualified}: {name}": (qualified, name)
    for qualified in NAMES
    for name in parameters(qualified)
    for text in [descriptions(qualified).get(name, "")]
    if re.match(r"([^.]*\bor )?jax\.random\.key", text) or (name == "key" and not text.startswith("int"))
}
"""Parameters that are named, or documented, as a key; some keys are integers, of other generators."""

NEEDED = {"qmcjax.integrate": {"replicates": 2}, "analysis.search_discrepancy": {"seconds": 60.0}}
NEEDED["qmcjax.sequences.halton"] = {"permutation": "random"}
"""What makes a function use its key."""


@some("place", {p: p for p in TAKING}, *(p for p in TAKING if TAKING[p][0] not in LONG))
def test_all_functions_take_the_same_keys(place):
    """A key of "rbg" is that of threefry with its seed, also where it was split."""
    qualified, name = TAKING[place]
    found = []
    for impl in ("threefry2x32", "rbg"):
        key = jax.random.split(jax.random.key(7, impl=impl))[1]
        result = target(qualified)(**right_call(qualified) | NEEDED.get(qualified, {}) | {name: key})
        found.append(known(result._replace(seconds=0.0) if hasattr(result, "seconds") else result))
    assert len(TAKING) >= 35 and found[0] == found[1]


# Anything in any place.


@cache
def wrong_things():
    """Return what may come in the place of anything: small and of few shapes, since it may be right."""
    numbers = [-1, 0, 1, 2, 3, 2**33, 2**64, -(2**70), True, False, np.int64(2), np.uint8(3), np.bool_(True)]
    numbers += [0.5, -0.5, 2.0, math.nan, math.inf, -math.inf, 1e300, np.float32(0.25), 1j, jnp.int32(2)]
    texts = ["", "hash", "owen", "sobol", b"bytes", "0.5"]
    arrays = [np.zeros(0), np.zeros((2, 2)), np.zeros((4, 2), np.int32), np.full((2, 2), np.nan), POINTS > 0]
    arrays += [np.array(["a"]), np.array([None]), np.zeros((2, 2), complex), np.zeros((1, 1, 1, 1))]
    arrays += [jnp.ones((2, 2)), jnp.arange(2, dtype=jnp.uint32), jax.random.key(0), jax.random.key(0)[None]]
    plain = [None, (), (1, 2), (0.5, 0.5), ("x", "y"), [[0.1], [0.2, 0.3]], {}, {"a": 1}, {2: 1}, {0.5}]
    plain += [Plain(), int, constant, lambda: None, math, Ellipsis, slice(2), range(2), iter(())]
    plain += [qmc.Sobol(2), qmc.Sobol(2, rng=0).random(4), SimpleNamespace(dims=2), np.float32, "float32"]
    return [*numbers, *texts, *arrays, *plain, *nouns().values(), *nowhere_right()]


def is_named(name, message):
    """Tell whether a message begins with what is wrong with an argument."""
    return re.search(rf"(?<![\w.])({name})\b", re.split(r" must | got ", message)[0]) is not None


def outcome(qualified, arguments, wrong):
    """Call a function; return None, or how it fails other than by an error that names a wrong argument."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = target(qualified)(**arguments)
            result = list(result) if isinstance(result, Iterator) else result
    except (TypeError, ValueError) as error:
        # Of any argument, as they may not fit together; or of the file that is read, "given.txt" and others.
        if wrong and any(is_named(name, str(error)) for name in (*parameters(qualified), r"\S+/given\S+")):
            return None
        return f"{type(error).__name__}: {str(error)[:150]}"
    except OSError as error:
        return None if "path" in wrong else f"{type(error).__name__}: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:150]}"
    arrays = [leaf for leaf in jax.tree.leaves(result) if isinstance(leaf, np.ndarray | jax.Array)]
    known = [np.asarray(a) for a in arrays if not jnp.issubdtype(a.dtype, jax.dtypes.prng_key)]
    undefined = any(a.dtype.kind in "fc" and np.isnan(a).any() for a in known)
    return "a result that is not a number" if undefined and "anisotropy" not in qualified else None


def shown(arguments):
    return ", ".join(f"{name}={qmcjax.core.checks.shown(value)}" for name, value in arguments.items())


def failures(qualified, things):
    """Return how calls with one wrong argument end otherwise than they may."""
    failed = []
    for name in places(qualified):
        for wrong in things:
            if name in FUNCTIONS and callable(wrong) and wrong is not constant:
                continue
            arguments = {**right_call(qualified), name: wrong}
            found = outcome(qualified, arguments, {name})
            if found is not None:
                failed.append(f"{qualified}({shown(arguments)}): {name}: {found}")
    return failed


INCOMPLETE = ("qmcjax.pytree", "qmcjax.sequences.rotate")
"""They do not take what must not be left out alone: one is a decorator, one needs an offset or a key."""


@pytest.mark.slow
@pytest.mark.parametrize("qualified", NAMES)
def test_one_wrong_argument(qualified):
    """None of them makes a function end otherwise than it may; all that are right are taken."""
    assert qualified in INCOMPLETE or outcome(qualified, right_call(qualified), ()) is None
    failed = failures(qualified, few_wrong_things() if qualified in LONG else wrong_things())
    assert not failed, "\n".join([f"{len(failed)} calls", *failed])
