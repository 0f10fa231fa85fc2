"""Digests of the inputs of a computation, and the names of code that they do not cover.

A digest covers arrays, plain values, and the names of types and functions. Versions identify the code of
qmcjax, JAX, NumPy and SciPy (see :func:`environment`). Other code can change under its name: it is listed as
foreign.
"""

import functools
import hashlib
import importlib.metadata
import os
import platform
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core.jax_internals import FLAGS

_ROOT = __name__.split(".")[0]
_VERSIONED = ("jax", "jaxlib", "numpy", "scipy")
_PLAIN = (bool, int, float, complex, str, bytes, range, type(None), type(Ellipsis))


def digest(name: str, value: Any) -> tuple[str, list[str]]:
    """Return 64 hexadecimal digits, the same in every process, and the foreign parts of an object.

    A tracer in the object raises a TypeError that begins with ``name``.
    """
    foreign: dict[str, None] = {}
    return _of(value, name, foreign).hex(), list(foreign)


def environment() -> dict[str, str]:
    """Return all that results depend on besides arguments and device."""
    found = {_ROOT: f"{importlib.metadata.version(_ROOT)}, sources {_sources()}"}
    for name in (*_VERSIONED, "numba"):  # Numba rounds differently from JAX.
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    found["python"] = ".".join(platform.python_version_tuple()[:2])
    found |= {name: str(getattr(jax.config, name, None)) for name in map("jax_{}".format, FLAGS)}
    options = os.environ.get("XLA_FLAGS", "").split()
    return found | {"XLA_FLAGS": " ".join(each for each in options if "device_count" not in each)}


@functools.cache
def _sources() -> str:
    folder = Path(__file__).parents[1]
    sources = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        sources.update(f"{path.relative_to(folder).as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return sources.hexdigest()[:12]


def _of(value: Any, name: str, foreign: dict[str, None]) -> bytes:
    """Return the digest of an object, and list its foreign parts."""
    kind = type(value)
    if kind in _PLAIN or isinstance(value, np.dtype):
        return _hashed(kind.__name__, value if isinstance(value, bytes) else repr(value).encode())
    if isinstance(value, Tracer):
        raise TypeError(f"{name} must be known, got a tracer of jax.jit or another transformation")
    called = ".".join(_path(value))
    if _is_named(value):
        return _hashed(called, b"")
    contents = _contents(value)
    if contents is None or not _is_named(kind):
        foreign[f"{name}: {called}"] = None
    parts = [_of(part, name, foreign) for part in (_visible(value) if contents is None else contents)]
    return _hashed(called, b"".join(sorted(parts) if isinstance(value, set | frozenset) else parts))


def _hashed(tag: str, data: bytes) -> bytes:
    return hashlib.sha256(f"{tag}\0".encode() + data).digest()


def _contents(value: Any) -> list[Any] | None:
    """Return the contents of an array, container or dataclass of a library; None for anything else."""
    if isinstance(value, Array) and jax.numpy.issubdtype(value.dtype, jax.dtypes.prng_key):
        return [str(value.dtype), jax.random.key_data(value)]
    if isinstance(value, np.ndarray | np.generic | Array):
        return [f"{np.asarray(value).dtype!r} {value.shape}", np.asarray(value).tobytes()]
    if isinstance(value, dict):
        return list(value.items())
    if isinstance(value, tuple | list | set | frozenset):
        return list(value)
    if isinstance(value, slice):
        return [value.start, value.stop, value.step]
    if is_dataclass(type(value)) and _is_named(type(value)):
        return [getattr(value, each.name) for each in fields(value)]
    return None


def _visible(value: Any) -> list[Any]:
    """Return the parts of a foreign pytree, or the attributes with plain values."""
    children = jax.tree.leaves(value, is_leaf=lambda part: part is not value)
    own = {} if isinstance(value, type) else getattr(value, "__dict__", {})
    plain = {k: each for k, each in own.items() if type(each) in _PLAIN and not k.startswith("__")}
    return [*(each for each in children if each is not value), *sorted(plain.items())]


def _path(value: Any) -> tuple[str, str]:
    """Return the module and the name of a function or type, or else of an object's type."""
    if isinstance(value, np.ufunc):  # NumPy 2.0 and 2.1 give it no module.
        return "numpy", value.__name__
    named = value if isinstance(getattr(value, "__qualname__", None), str) else type(value)
    return str(named.__module__), named.__qualname__


def _is_named(value: Any) -> bool:
    """Return whether a library holds this object under its name."""
    module, name = _path(value)
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    return found is value and module.split(".")[0] in (_ROOT, "builtins", *_VERSIONED)
