"""A word for what an object is made of: the same in every process, another for any other values or code.

Objects are taken apart down to numbers, strings and the bytes of arrays, functions of users down to their
bytecode and the values that it refers to. What libraries define is known by its name, and by their versions
(see :func:`versions`).
"""

import dis
import functools
import hashlib
import importlib.metadata
import platform
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import jax
import numpy as np
from jax import Array
from jax.core import Tracer

from qmcjax.core import checks

_ROOT = __name__.split(".")[0]
_LIBRARIES = frozenset({_ROOT, "jax", "jaxlib", "numpy", "scipy", *sys.stdlib_module_names}) - {"__main__"}


def digest(name: str, value: Any) -> str:
    """Return 64 hexadecimal digits that tell an object from any other.

    Parameters
    ----------
    name : str
        What the object is called in an error message.
    value : Any
        Made of dataclasses, plain objects, functions, containers, arrays, keys, numbers and strings.

    Returns
    -------
    str

    Raises
    ------
    TypeError
        If a part of it cannot be told apart from others, such as a generator or a tracer.
    """
    return _Walk().of(value, name).hex()


@functools.cache
def versions() -> dict[str, str]:
    """Return what a computation depends on beside its arguments: versions, and this package's own sources.

    Bits may differ between kinds of devices, and with the global x64 flag.
    """
    folder = Path(__file__).parents[1]
    sources = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        sources.update(f"{path.relative_to(folder).as_posix()}\0".encode() + path.read_bytes() + b"\0")
    return {
        _ROOT: f"{importlib.metadata.version(_ROOT)}, sources {sources.hexdigest()[:12]}",
        "jax": importlib.metadata.version("jax"),
        "numpy": np.__version__,
        "python": ".".join(platform.python_version_tuple()[:2]),
    }


class _Walk:
    """One way through an object and all that it refers to."""

    def __init__(self) -> None:
        self.above: list[int] = []
        """What contains the object that is looked at: one that contains itself is not taken apart again."""
        self.known: dict[int, bytes] = {}
        """Functions and classes, to which many objects refer."""

    def of(self, value: Any, name: str) -> bytes:
        """Return the digest of an object, for whose place the name stands in messages."""
        if value is None or value is Ellipsis or type(value) in (bool, int, float, complex, str, bytes):
            return _hashed(type(value).__name__, repr(value).encode())
        if id(value) in self.above:
            return _hashed("above", str(len(self.above) - self.above.index(id(value))).encode())
        if id(value) in self.known:
            return self.known[id(value)]
        self.above.append(id(value))
        try:
            found = self._of(value, name)
        finally:
            self.above.pop()
        if isinstance(value, FunctionType | type):
            self.known[id(value)] = found
        return found

    def _of(self, value: Any, name: str) -> bytes:
        if isinstance(value, Tracer):
            raise TypeError(f"{name} must be known, got a tracer of jax.jit or another transformation")
        if isinstance(value, np.ndarray | np.generic | Array):
            return self._array(value, name)
        if isinstance(value, CodeType):
            return self._all("code", _of_code(value), name)
        if isinstance(value, FunctionType):
            return self._function(value, name)
        if isinstance(value, type):
            return self._class(value, name)
        if isinstance(value, ModuleType):
            return _module(value)
        if isinstance(value, Mapping):
            return self._all(_name(type(value)), [part for item in value.items() for part in item], name)
        if isinstance(value, set | frozenset):
            return _hashed(_name(type(value)), *sorted(self.of(item, name) for item in value))
        if isinstance(value, MethodType):
            return self._all("method", (value.__func__, value.__self__), name)
        if _is_global(value):
            return _hashed("global", _name(value).encode())
        if (wrapped := getattr(value, "__wrapped__", None)) is not None:  # As jax.jit makes it.
            return self._all(_name(type(value)), (wrapped,), name)
        kind = self.of(type(value), f"{name}'s class {type(value).__name__}")
        if isinstance(value, tuple | list):
            items = (self.of(item, f"{name}[{k}]") for k, item in enumerate(value))
            return _hashed("items", kind, *items)
        if is_dataclass(value):
            return _hashed(
                "dataclass", kind, *self._named({f.name: getattr(value, f.name) for f in fields(value)}, name)
            )
        return _hashed("object", kind, *self._reduced(value, name))

    def _all(self, tag: str, parts: Iterable[Any], name: str) -> bytes:
        return _hashed(tag, *(self.of(part, name) for part in parts))

    def _named(self, parts: Mapping[str, Any], name: str) -> list[bytes]:
        return [_hashed(key, self.of(part, f"{name}.{key}")) for key, part in sorted(parts.items())]

    def _array(self, value: Any, name: str) -> bytes:
        if isinstance(value, Array) and jax.numpy.issubdtype(value.dtype, jax.dtypes.prng_key):
            return _hashed(str(value.dtype), self.of(np.asarray(jax.random.key_data(value)), name))
        known = np.asarray(value)
        if known.dtype.hasobject:
            return self._all(f"objects {known.shape}", known.ravel().tolist(), name)
        return _hashed(
            f"array {known.dtype.str} {known.shape}",
            np.ascontiguousarray(known).data.cast("B") if known.size else b"",
        )

    def _function(self, value: FunctionType, name: str) -> bytes:
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        bound = [*cells, value.__defaults__, value.__kwdefaults__]
        if _is_of_library(value):
            return self._all(f"function {_name(value)}", bound, f"{name} ({value.__qualname__})")
        place = f"{name} (function {value.__name__})"
        used = {key: value.__globals__[key] for key in _globals(value.__code__) if key in value.__globals__}
        return _hashed(
            "function",
            self._all("bound", (value.__code__, *bound), place),
            *(_hashed(key, self.of(part, f"{place}: {key}")) for key, part in sorted(used.items())),
        )

    def _class(self, value: type, name: str) -> bytes:
        if _is_of_library(value):
            return _hashed("class", _name(value).encode())
        parts = {key: _unwrapped(member) for key, member in vars(value).items() if _counts(key, member)}
        bases = self.of(value.__bases__, name)
        return _hashed("class", value.__qualname__.encode(), bases, *self._named(parts, name))

    def _reduced(self, value: Any, name: str) -> Iterable[bytes]:
        """Take an object apart as ``copy`` and ``pickle`` do."""
        try:
            reduced = value.__reduce_ex__(4)
        except Exception as error:  # Whatever code of the object's own raises.
            raise TypeError(
                f"{name} must be made of dataclasses, functions, arrays and plain values, so that its "
                f"checkpoint can be told from others, got {checks.shown(value)}: leave it out of what is "
                "computed, or do without a checkpoint"
            ) from error
        if isinstance(reduced, str):
            return [_hashed("global", reduced.encode())]
        make, args, state, *items = (*reduced, *[None] * 5)[:5]
        if isinstance(state, dict):
            known = {key: part for key, part in state.items() if not _is_cached(type(value), key)}
            parts = self._named(known, name)
        else:
            parts = [self.of(state, name)]
        contained = [list(each) if each is not None else None for each in items]
        return [self.of(make, name), self.of(args, name), *parts, self.of(contained, name)]


def _hashed(tag: str, *parts: Any) -> bytes:
    sha = hashlib.sha256(f"{tag}\0{len(parts)}\0".encode())
    for part in parts:
        sha.update(len(part).to_bytes(8, "little"))
        sha.update(part)
    return sha.digest()


def _name(value: Any) -> str:
    return f"{value.__module__}.{getattr(value, '__qualname__', None) or value.__name__}"


def _is_of_library(value: Any) -> bool:
    return (getattr(value, "__module__", None) or "").split(".")[0] in _LIBRARIES


def _is_global(value: Any) -> bool:
    """Tell whether a library knows an object by a name: a compiled function, or one of NumPy's or JAX's."""
    if isinstance(value, BuiltinFunctionType):
        return value.__self__ is None or isinstance(value.__self__, ModuleType)
    name = getattr(value, "__qualname__", None) or getattr(value, "__name__", None)
    module = sys.modules.get(getattr(value, "__module__", None) or "")
    return isinstance(name, str) and _is_of_library(value) and getattr(module, name, None) is value


def _of_code(code: CodeType) -> tuple[Any, ...]:
    """Return all of a function's code that matters: not where it stands, nor what it is called."""
    constants = code.co_consts
    return code.co_code, constants, code.co_names, code.co_freevars, code.co_flags, code.co_argcount


def _globals(code: CodeType) -> set[str]:
    """Return the names that code and the functions in it look up outside."""
    names = {
        each.argval for each in dis.get_instructions(code) if each.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    }
    inside = (_globals(each) for each in code.co_consts if isinstance(each, CodeType))
    return names.union(*inside)


def _counts(key: str, member: Any) -> bool:
    """Tell whether an attribute of a class is its author's."""
    if isinstance(member, FunctionType):
        return member.__code__.co_filename != "<string>"  # What ``dataclass`` writes follows from the fields.
    made = key.startswith("__") or key == "_abc_impl" or type(member).__name__ == "member_descriptor"
    return not made


def _is_cached(kind: type, key: str) -> bool:
    return isinstance(getattr(kind, key, None), functools.cached_property)


def _unwrapped(member: Any) -> Any:
    """Return the functions behind a descriptor of a class."""
    if isinstance(member, property):
        return member.fget, member.fset
    if isinstance(member, staticmethod | classmethod):
        return member.__func__
    return member.func if isinstance(member, functools.cached_property) else member


def _module(module: ModuleType) -> bytes:
    """Return the digest of a module: of its name, and of the file of a user's."""
    path = getattr(module, "__file__", None)
    if path is None or module.__name__.split(".")[0] in _LIBRARIES:
        return _hashed("module", module.__name__.encode())
    return _hashed("module", module.__name__.encode(), Path(path).read_bytes())
