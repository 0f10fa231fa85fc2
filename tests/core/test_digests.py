"""Digests of what a computation is made of; foreign code takes a label."""

import importlib
import importlib.metadata
import sys
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences
from qmcjax.core import jax_internals
from qmcjax.core.checkpoints import begin, digest

sys.path.insert(0, str(Path(__file__).parents[1]))
from tables import KINDS, SAMPLERS, SEQUENCES


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
    "another slice": lambda: {"a": [1, 2.0, None], "b": (np.float32(1), {1, 2}, np.s_[:3, 1::2])},
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


@dataclass
class Plain:
    size: float
    whole: object = None

    def __post_init__(self):
        self.whole = self


def test_arrays_and_plain_values_in_foreign_objects_count_all_the_same():
    made = [
        Rings(jnp.arange(3.0), scenes.disc()),
        Rings(jnp.arange(4.0), scenes.disc()),
        Rings(jnp.arange(3.0), scenes.disc((0.5, 0.5), 0.1)),
        Plain(2.0),
        Plain(3.0),
    ]
    found = [digest("scene", each) for each in made]
    assert len({hexadecimal for hexadecimal, _ in found}) == len(made)
    names = [[f"scene: {__name__}.{type(each).__name__}"] for each in made]
    assert [foreign for _, foreign in found] == names


def test_what_is_not_known_is_named():
    with pytest.raises(TypeError, match="key must be known, got a tracer"):
        jax.jit(lambda key: digest("key", key)[0])(jax.random.key(1))


FLAGS = {
    "jax_threefry_partitionable": lambda: jax.threefry_partitionable(False),
    "jax_enable_x64": lambda: jax.enable_x64(True),
    "jax_default_matmul_precision": lambda: jax.default_matmul_precision("float32"),
    "jax_disable_jit": jax.disable_jit,
    "jax_default_prng_impl": lambda: jax.default_prng_impl("rbg"),
}


@pytest.mark.parametrize("flag", FLAGS)
def test_flags_that_change_bits(tmp_path, flag):
    begin(tmp_path / "state", spp=4)
    with FLAGS[flag](), pytest.raises(ValueError, match=f"where {flag} was [^ ,]*, is [^ ,]*: give"):
        begin(tmp_path / "state", spp=4)
    begin(tmp_path / "state", spp=4)


def test_flags_are_those_of_jax():
    """Those of all versions are; of the others two."""
    unknown = {flag for flag in jax_internals.FLAGS if f"jax_{flag}" not in jax.config.values}
    assert len(unknown) <= 2 and not unknown & set(jax_internals.COMMON_FLAGS)


@pytest.mark.parametrize("name", ["jax", "jaxlib", "numpy", "scipy", "numba"])
def test_versions(tmp_path, monkeypatch, name):
    """Of what computes, too whether it is there at all."""
    begin(tmp_path / "state", spp=4)
    version = importlib.metadata.version

    def other(asked):
        if asked == name:
            raise importlib.metadata.PackageNotFoundError
        return version(asked)

    monkeypatch.setattr(importlib.metadata, "version", other)
    with pytest.raises(ValueError, match=rf"where {name} was \d\S*, is not installed:"):
        begin(tmp_path / "state", spp=4)


def test_xla_options_but_not_the_number_of_devices(tmp_path, monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "")
    begin(tmp_path / "state", spp=4)
    monkeypatch.setenv("XLA_FLAGS", "--xla_force_host_platform_device_count=3")
    begin(tmp_path / "state", spp=4)
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_enable_fast_math=true")
    with pytest.raises(ValueError, match="where XLA_FLAGS was , is --xla_cpu_enable_fast_math=true:"):
        begin(tmp_path / "state", spp=4)


def edited(body, made="K()"):
    """Return a function from a number, which an edit changes, to the source of a plug-in."""
    return lambda k: f"import functools, jax\n{body}\nmade = {made}\n".replace("{k}", str(k))


EDITS = {
    # What the bytecode of methods and functions does not show.
    "method under partial(jax.jit)": edited(
        "class K:\n @functools.partial(jax.jit, static_argnums=0)\n def __call__(self, p): return {k} * p"
    ),
    "staticmethod": edited("class K:\n @staticmethod\n def __call__(p): return {k} * p"),
    "partialmethod": edited(
        "class K:\n def of(self, p, a): return a * p\n __call__ = functools.partialmethod(of, a={k})"
    ),
    "attribute __k__": edited("class K:\n __k__ = {k}\n def __call__(self, p): return self.__k__ * p"),
    "class by exec": edited("exec('class K:\\n def __call__(self, p): return {k} * p')"),
    "function by exec": edited("names = {}\nexec('def f(p): return {k} * p', names)", "names['f']"),
    "deeper module": edited("import package.deep.k\ndef f(p): return package.deep.k.K * p", "f"),
    "import in a method": edited(
        "class K:\n def __call__(self, p):\n  from package.deep.k import K\n  return K * p"
    ),
    "package through attributes": edited("import package\ndef f(p): return package.deep.k.K * p", "f"),
    "attribute of a function": edited("def f(p): return f.k * p\nf.k = {k}", "f"),
    "update_wrapper": edited(
        "def f(p): return p\ndef g(p): return {k} * p\nfunctools.update_wrapper(g, f)", "g"
    ),
    "update_wrapper around a library's": edited(
        "@functools.wraps(jax.numpy.where)\ndef f(p): return {k} * p", "f"
    ),
    "attribute set afterwards": edited(
        "class K:\n __slots__ = 'k',\n def __call__(self, p): return self.k * p\nk = K()\nk.k = {k}", "k"
    ),
    "list with state": edited("class K(list):\n k = {k}\n def __call__(self, p): return self.k * p"),
    "dict with state": edited("class K(dict):\n k = {k}\n def __call__(self, p): return self.k * p"),
    "metaclass": edited(
        "class M(type): k = {k}\nclass K(metaclass=M):\n def __call__(self, p): return type(self).k * p"
    ),
    # What it shows.
    "constant": edited("def f(p): return {k} * p", "f"),
    "global": edited("K = {k}\ndef f(p): return K * p", "f"),
    "helper": edited("def g(p): return {k} * p\ndef f(p): return g(p)", "f"),
    "default": edited("def f(p, k={k}): return k * p", "f"),
    "closure": edited("def of(k):\n def f(p): return k * p\n return f", "of({k})"),
    "lambda": edited("", "lambda p: {k} * p"),
    "compiled": edited("def f(p): return {k} * p", "jax.jit(f)"),
    "partial": edited("def f(k, p): return k * p", "functools.partial(f, {k})"),
    "method": edited("class K:\n def __call__(self, p): return {k} * p"),
    "bound method": edited("class K:\n def of(self, p): return {k} * p", "K().of"),
    "inherited": edited("class B:\n def __call__(self, p): return {k} * p\nclass K(B): pass"),
    "attribute of a class": edited("class K:\n k = {k}\n def __call__(self, p): return self.k * p"),
    "property": edited(
        "class K:\n @property\n def k(self): return {k}\n def __call__(self, p): return self.k * p"
    ),
    "named as a builtin": edited(
        "exec('def f(p): return {k} * p', {'__name__': 'builtins'}, g := {})", "g['f']"
    ),
}


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    """Import a plug-in, and the package that it uses, as another process would after an edit."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "package" / "deep").mkdir(parents=True)
    for folder, text in (
        ("package", "from package import deep\n"),
        ("package/deep", "from package.deep import k\n"),
    ):
        (tmp_path / folder / "__init__.py").write_text(text)

    def load(edit, k):
        (tmp_path / "package" / "deep" / "k.py").write_text(f"K = {k}\n")
        (tmp_path / "plug_in.py").write_text(edit(k))
        for name in ("plug_in", "package", "package.deep", "package.deep.k"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("plug_in").made

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield load
    for name in ("plug_in", "package", "package.deep", "package.deep.k"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS.keys())
def test_an_edit_of_a_plug_in_takes_a_label(tmp_path, plugged, edit):
    """Without a label nothing is begun; another one is refused; the same one is its author's word."""

    def begun(checkpoint, k):
        return begin(checkpoint, scene=scenes.function(plugged(edit, k), ("x", "y")), spp=4)

    path = tmp_path / "state"
    with pytest.raises(
        ValueError, match=r"must be a qmcjax\.Checkpoint .* foreign code .*state' and scene: "
    ):
        begun(path, 1)
    assert not path.exists()
    begun(qj.Checkpoint(path, "1"), 1).write(done=3)
    with pytest.raises(ValueError, match="where label was '1', is '2'"):
        begun(qj.Checkpoint(path, "2"), 2)
    assert begun(qj.Checkpoint(path, "1"), 1).state["done"] == 3
