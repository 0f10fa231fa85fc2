"""Files with the state of a computation: whole at any time, and taken for no other computation's."""

import functools
import importlib.metadata
import os
import resource
import time
from dataclasses import dataclass
from functools import partial
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tables import KINDS, SAMPLERS, SEQUENCES

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core import checkpoints, jax_internals
from qmcjax.core.checkpoints import Checkpoint, begin, digest

DISC = scenes.disc()


def keep(path, **state):
    begin(path, scene=DISC, spp=4).write(**state)


def test_what_was_written_is_read(tmp_path):
    path = tmp_path / "state"
    first = begin(path, scene=DISC, spp=4)
    assert first.state == {}
    assert path.is_file()
    first.write(total=np.arange(3.0), done=7)
    found = begin(str(path), scene=scenes.disc(), spp=4).state
    np.testing.assert_array_equal(found["total"], np.arange(3.0))
    assert (int(found["done"]), len(found)) == (7, 2)
    assert os.listdir(tmp_path) == ["state"]


OTHERS = [
    ({"scene": DISC, "spp": 8}, r"where spp was 4, is 8: give another path"),
    ({"scene": scenes.disc((0.5, 0.5), 0.1), "spp": 4}, "where scene is another one:"),
    ({"scene": DISC, "sampler": DISC}, "where spp was 4, is None, sampler is another one:"),
]


@pytest.mark.parametrize("other, message", OTHERS)
def test_another_computation_is_refused(tmp_path, other, message):
    keep(tmp_path / "state", done=1)
    with pytest.raises(
        ValueError, match=f"^checkpoint must belong to this computation, got '.*state', {message}"
    ):
        begin(tmp_path / "state", **other)


def test_labels(tmp_path):
    """Any text, which counts where there is no foreign code, too."""
    path, long = tmp_path / "state", "v2 " * 40
    keep(path, done=1)
    with pytest.raises(ValueError, match=f"where label was None, is '{long}': give"):
        keep(Checkpoint(path, long))
    path.unlink()
    keep(Checkpoint(path, long), done=1)
    with pytest.raises(ValueError, match=f"where label was '{long}', is None: give"):
        keep(path)
    assert begin(Checkpoint(str(path), long), scene=DISC, spp=4).state["done"] == 1


@pytest.mark.parametrize("kind", ["empty", "text", "cut", "flipped", "array", "format", "pickle"])
def test_a_damaged_or_foreign_file_is_refused_and_stays(tmp_path, kind):
    path = tmp_path / "state"
    keep(path, total=np.arange(1000.0))
    whole = path.read_bytes()
    if kind == "array":
        with open(path, "wb") as file:
            np.save(file, np.arange(3))
    elif kind == "format":
        header = str(np.load(path)["header"]).replace("checkpoint 1", "checkpoint 2")
        with open(path, "wb") as file:
            np.savez(file, header=np.array(header))
    elif kind == "pickle":
        with open(path, "wb") as file:
            np.savez(file, header=np.array([{}], dtype=object), allow_pickle=True)
    else:
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        path.write_bytes({"empty": b"", "text": b"hello", "cut": whole[:middle], "flipped": flipped}[kind])
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"checkpoint must be a checkpoint file, got .* delete it"):
        keep(path)
    assert path.read_bytes() == before


NO_PATH = "must be the path of a file or a Checkpoint, got 3"
FOLDER = r"must be the path of a file, got a folder: '\.'"


@pytest.mark.parametrize(
    ("path", "error", "message"),
    [
        (3, TypeError, NO_PATH),
        (Checkpoint(3, "v1"), TypeError, NO_PATH),
        (Checkpoint("state", 1), TypeError, "must have a string as label, got 1"),
        *((path, ValueError, FOLDER) for path in (Checkpoint(".", "v1"), "", ".")),
        ("missing/state", ValueError, ".* got one in a folder that is not there: 'missing/state'"),
    ],
)
def test_what_is_no_path_of_a_file(tmp_path, monkeypatch, path, error, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=f"checkpoint {message}"):
        begin(path, spp=1)


def test_a_full_disk_leaves_the_last_one(tmp_path):
    """The limit of a file's size makes a write fail in the middle, as a full disk does."""
    path = tmp_path / "state"
    held = begin(path, spp=1)
    held.write(total=np.arange(10.0))
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2 * len(before), hard))
    try:
        with pytest.warns(RuntimeWarning, match=r"checkpoint '.*' cannot be written, the previous .*large"):
            held.write(total=np.zeros(10_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["state"]
    held.write(total=np.zeros(10_000))
    assert begin(path, spp=1).state["total"].shape == (10_000,)


def test_what_killed_processes_left_is_cleared_away(tmp_path):
    path = tmp_path / "state[1]"
    for name in (".state[1].part-99-far-away", ".state1.part-99-far-away"):
        (tmp_path / name).write_bytes(b"half")
    keep(path, done=2)
    assert sorted(os.listdir(tmp_path)) == [".state1.part-99-far-away", "state[1]"]


def test_another_run_of_the_same_costs_one_write(tmp_path, monkeypatch):
    path = tmp_path / "state"
    held = begin(path, spp=1)
    held.write(done=0)
    with monkeypatch.context() as patched:
        patched.setattr(checkpoints.os, "fsync", lambda file: begin(path, spp=1))
        with pytest.warns(RuntimeWarning, match="cannot be written, the previous one stays"):
            held.write(done=1)
    assert begin(path, spp=1).state["done"] == 0
    held.write(done=2)
    assert begin(path, spp=1).state["done"] == 2


def test_writes_take_a_small_share_of_the_time(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)
    held = begin(tmp_path / "state", spp=1)
    assert held.due()
    monkeypatch.setattr(checkpoints.os, "fsync", lambda file: time.sleep(0.05))
    held.write(done=1)
    assert not held.due()
    assert held._next - time.monotonic() > 0.5
    monkeypatch.setattr(checkpoints, "EVERY", 60.0)
    assert not begin(tmp_path / "state", spp=1).due()


def test_the_state_of_an_outer_loop_is_written_with_that_of_an_inner_one(tmp_path):
    held = begin(tmp_path / "state", spp=1)
    held.outer = {"images": np.ones(2)}
    held.write(row=3)
    found = begin(tmp_path / "state", spp=1).state
    assert {name: each.tolist() for name, each in found.items()} == {"images": [1, 1], "row": 3}


def sampler(key=1, order=orders.hilbert):
    return samplers.contiguous(order(4, 4), sequences.owen(sequences.sobol(2), key), spp=4)


OWN = {
    "sampler": sampler,
    "another key": lambda: sampler(2),
    "another order": lambda: sampler(order=orders.morton),
    "scene": scenes.disc,
    "other radius": lambda: scenes.disc((0.5, 0.5), 0.1),
    "traced": scenes.cornell_box,
    "traced, blocks": lambda: scenes.cornell_box(blocks=True),
    "containers": lambda: {"a": [1, 2.0, None], "b": (np.float32(1), {1, 2}, np.s_[:3, 1:])},
    "other slices": lambda: {"a": [1, 2.0, None], "b": (np.float32(1), {1, 2}, np.s_[:3, 2:])},
    "functions of libraries": lambda: [jnp.sin, np.sin, orders.hilbert, np.float32, np.dtype("float32")],
    "one of them": lambda: scenes.function(jnp.sum, ("x", "y")),
    "another order in a list": lambda: {"a": [2.0, 1, None], "b": (np.float32(1), {1, 2}, np.s_[:3, 1:])},
    "key": lambda: jax.random.key(3, impl="unsafe_rbg"),
    "key of another kind": lambda: jax.random.key(3, impl="rbg"),
    "array": lambda: np.arange(6).reshape(2, 3),
    "array of another shape": lambda: np.arange(6).reshape(3, 2),
    "array of another dtype": lambda: np.arange(6, dtype=np.int32).reshape(2, 3),
    "array in another order": lambda: np.arange(6, dtype=">i4").reshape(2, 3),
}
"""No two are the same, and none is foreign."""


def test_no_two_are_the_same_and_made_again_each_is():
    first = {name: digest(name, make()) for name, make in OWN.items()}
    assert len({hexadecimal for hexadecimal, _ in first.values()}) == len(OWN)
    assert {name: digest(name, make()) for name, make in OWN.items()} == first
    assert not any(foreign for _, foreign in first.values())
    one, other = {0, 8}, {8, 0}
    assert list(one) != list(other)
    assert digest("set", one) == digest("set", other)


@pytest.mark.slow
def test_the_library_is_not_foreign():
    """Its nouns differ, and need no label."""
    made = {name: SAMPLERS[name] for name in SAMPLERS if not name.startswith("randomized")}
    made |= {name: SEQUENCES[name] for name in KINDS}
    made |= {name: getattr(scenes, name)() for name in ("helicopter", "occluder", "ball", "checkerboard")}
    found = {name: digest(name, each) for name, each in made.items()}
    assert [name for name, (_, foreign) in found.items() if foreign] == []
    assert len({hexadecimal for hexadecimal, _ in found.values()}) == len(found)


@qj.pytree
@dataclass(frozen=True)
class Rings:
    value: jax.Array
    inner: object

    def __call__(self, point):
        return self.value * point[..., 0]


def test_arrays_in_foreign_pytrees_count_all_the_same():
    given = (3.0, scenes.disc()), (4.0, scenes.disc()), (3.0, scenes.disc((0.5, 0.5), 0.1))
    made = [Rings(jnp.arange(count), inner) for count, inner in given]
    found = [digest("scene", each) for each in made]
    assert len({hexadecimal for hexadecimal, _ in found}) == len(made)
    assert [foreign for _, foreign in found] == [[f"scene: {__name__}.Rings"]] * len(made)


def test_what_is_not_known_is_named():
    with pytest.raises(TypeError, match="key must be known, got a tracer"):
        jax.jit(lambda key: digest("key", key)[0])(jax.random.key(1))


def without(name):
    """Return a context in which a package is not installed."""
    version = importlib.metadata.version

    def other(asked):
        if asked == name:
            raise importlib.metadata.PackageNotFoundError
        return version(asked)

    return mock.patch.object(importlib.metadata, "version", other)


ELSEWHERE = {
    "jax_threefry_partitionable": lambda: jax.threefry_partitionable(False),
    "jax_enable_x64": lambda: jax.enable_x64(True),
    "jax_default_matmul_precision": lambda: jax.default_matmul_precision("float32"),
    "jax_disable_jit": jax.disable_jit,
    "jax_default_prng_impl": lambda: jax.default_prng_impl("rbg"),
    "XLA_FLAGS": lambda: mock.patch.dict(os.environ, XLA_FLAGS="--xla_cpu_enable_fast_math=true"),
    "device": lambda: mock.patch.object(checkpoints.devices, "kind", lambda mesh: "abacus"),
    "qmcjax": lambda: mock.patch.object(checkpoints, "_sources", lambda: "others"),
    **{name: partial(without, name) for name in ("jax", "jaxlib", "numpy", "scipy", "numba")},
}


@pytest.mark.parametrize("name", ELSEWHERE)
def test_a_state_is_of_one_version_device_and_choice_of_flags(tmp_path, name):
    begin(tmp_path / "state", spp=4)
    with ELSEWHERE[name](), pytest.raises(ValueError, match=rf"where {name} was .*, is .*: give"):
        begin(tmp_path / "state", spp=4)
    begin(tmp_path / "state", spp=4)


def test_the_number_of_devices_does_not_count(tmp_path, monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "")
    begin(tmp_path / "state", spp=4)
    monkeypatch.setenv("XLA_FLAGS", "--xla_force_host_platform_device_count=3")
    begin(tmp_path / "state", spp=4)


def test_flags_are_those_of_jax():
    """Those of all versions are; of the others two."""
    unknown = {flag for flag in jax_internals.FLAGS if f"jax_{flag}" not in jax.config.values}
    assert len(unknown) <= 2 and not unknown & set(jax_internals.COMMON_FLAGS)


class Scaled:
    def __call__(self, point):
        return 2 * point[..., 0]


class Listed(list):
    __call__ = Scaled.__call__


def scaled(point, factor=2):
    return factor * point[..., 0]


def by_exec(name):
    exec("def f(p): return 2 * p[..., 0]", {"__name__": name}, made := {})
    return made["f"]


FOREIGN = {
    "function": scaled, "lambda": lambda point: point[..., 0],
    "closure": (lambda k: lambda point: k * point[..., 0])(2), "compiled": jax.jit(scaled),
    "partial": functools.partial(scaled, factor=3),
    "wrapped as a library's": functools.wraps(jnp.where)(lambda point: point[..., 0]), "object": Scaled(),
    "bound method": Scaled().__call__, "list with a call": Listed(), "by exec": by_exec(__name__),
    "named as a builtin": by_exec("builtins"),
}  # fmt: skip


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_code_takes_a_label(tmp_path, name):
    """Without a label nothing is begun; another one is refused; the same one is its author's word."""

    def begun(checkpoint):
        return begin(checkpoint, scene=scenes.function(FOREIGN[name], ("x", "y")), spp=4)

    path = tmp_path / "state"
    with pytest.raises(ValueError, match=r"must be a qmcjax\.Checkpoint .* foreign .*state' and scene: "):
        begun(path)
    assert not path.exists()
    begun(qj.Checkpoint(path, "1")).write(done=3)
    with pytest.raises(ValueError, match="where label was '1', is '2'"):
        begun(qj.Checkpoint(path, "2"))
    assert begun(qj.Checkpoint(path, "1")).state["done"] == 3
