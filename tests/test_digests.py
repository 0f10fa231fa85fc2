"""Digests of what a computation is made of: the same in every process, others for other values and code."""

import functools
import json
import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core.digests import digest

SCALE = 2.0


def owen_pass(key):
    return samplers.contiguous(orders.hilbert(4, 4), sequences.owen(sequences.sobol(2), key), spp=4)


def scaled(point):
    return SCALE * jnp.sin(point[..., 0])


class Plain:
    needs = ("x", "y")

    def __init__(self, size):
        self.size = size

    @functools.cached_property
    def area(self):
        return self.size**2

    def __call__(self, point):
        return self.area * point[..., 0]


@qj.pytree
@dataclass(frozen=True)
class Leaves:
    value: jax.Array


class Chain:
    """It contains itself."""

    def __init__(self):
        self.next = [self]


MADE = {
    "sampler": lambda: samplers.contiguous(
        orders.hilbert(4, 4), sequences.owen(sequences.sobol(2), 1), spp=4
    ),
    "another key": lambda: samplers.contiguous(
        orders.hilbert(4, 4), sequences.owen(sequences.sobol(2), 2), spp=4
    ),
    "another order": lambda: samplers.contiguous(
        orders.morton(4, 4), sequences.owen(sequences.sobol(2), 1), spp=4
    ),
    "passes": lambda: samplers.randomized(owen_pass, 1),
    "scene": lambda: scenes.disc(),
    "other radius": lambda: scenes.disc((0.5, 0.5), 0.1),
    "traced": lambda: scenes.cornell_box(),
    "traced, blocks": lambda: scenes.cornell_box(blocks=True),
    "of a function": lambda: scenes.function(scaled, ("x", "y")),
    "of a lambda": lambda: scenes.function(lambda point: point[..., 0], ("x", "y")),
    "of another lambda": lambda: scenes.function(lambda point: point[..., 1], ("x", "y")),
    "compiled": lambda: scenes.function(jax.jit(scaled), ("x", "y")),
    "partial": lambda: functools.partial(scaled, 3.0),
    "plain": lambda: Plain(2.0),
    "plain, larger": lambda: Plain(3.0),
    "leaves": lambda: Leaves(jnp.arange(3.0)),
    "other leaves": lambda: Leaves(jnp.arange(4.0)),
    "in itself": Chain,
    "containers": lambda: {"a": [1, 2.0, None], "b": (np.float32(1), {1, 2})},
    "key": lambda: jax.random.key(3),
    "array": lambda: np.arange(6).reshape(2, 3),
    "array of another shape": lambda: np.arange(6).reshape(3, 2),
    "array of another dtype": lambda: np.arange(6, dtype=np.int32).reshape(2, 3),
    "path": lambda: Path("a"),
}
"""No two are the same."""


def digests():
    return {name: digest(name, make()) for name, make in MADE.items()}


def test_no_two_are_the_same_and_made_again_each_is():
    first = digests()
    assert len(set(first.values())) == len(MADE)
    assert digests() == first


@pytest.mark.slow
def test_another_process_finds_the_same():
    code = "import test_digests, json; print(json.dumps(test_digests.digests()))"
    command = [sys.executable, "-c", code]
    here = Path(__file__).parent
    environment = {**os.environ, "PYTHONPATH": str(here.parent)}
    ended = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=True)
    assert json.loads(ended.stdout) == digests()


def test_what_a_function_refers_to_counts(monkeypatch):
    before = digest("scene", scaled), digest("scene", Plain(2.0))
    monkeypatch.setitem(globals(), "SCALE", 3.0)
    assert digest("scene", scaled) != before[0]
    assert digest("scene", Plain(2.0)) == before[1]
    monkeypatch.setattr(Plain, "__call__", lambda self, point: point[..., 1])
    assert digest("scene", Plain(2.0)) != before[1]


def test_what_an_object_remembers_does_not_count():
    used = Plain(2.0)
    before = digest("scene", used)
    assert used.area == 4
    assert digest("scene", used) == before


def test_what_cannot_be_told_apart_is_named():
    lock = threading.Lock()

    def locked(point):
        with lock:
            return point[..., 0]

    with pytest.raises(TypeError, match=r"scene\S* \(function locked\) must be made of .* got .*lock"):
        digest("scene", scenes.function(locked, ("x", "y")))
    with pytest.raises(TypeError, match="key must be known, got a tracer"):
        jax.jit(lambda key: digest("key", key))(jax.random.key(1))
