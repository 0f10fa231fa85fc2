"""Dataclasses as JAX pytrees, with the class as part of the structure."""

import contextlib
import dataclasses
import functools
import importlib
import inspect
import json
import reprlib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, Generic, TypeVar, dataclass_transform

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer


def one_line(value: Any) -> str:
    """Return a dataclass in one line, without arrays.

    Nested objects come first, then the attributes that the class lists as ``reported``, by default its static
    fields, unless they are None or repeat those of a nested object. The name is that of the class, or its
    attribute ``called``.
    """
    inside, parts = [], []
    for field in fields(value):
        content = getattr(value, field.name, None)
        if not field.metadata.get("static") and is_dataclass(content):
            inside.append(content)
            parts.append(repr(content))
    choices = (field.name for field in fields(value) if field.metadata.get("static"))
    for name in getattr(type(value), "reported", choices):
        # JAX may print an object without its arrays.
        with contextlib.suppress(Exception):
            content = getattr(value, name)
            simple = isinstance(content, int | float | str | tuple) and len(repr(content)) < _SIMPLE
            if simple and all(getattr(part, name, None) != content for part in inside):
                parts.append(f"{name}={content!r}")
    return f"{getattr(value, 'called', type(value).__name__)}({', '.join(parts)})"


_SIMPLE = 40
"""Attributes with a longer repr are omitted."""


def equal(one: Any, other: Any) -> Any:
    """Return whether two pytrees have the same structure, and known arrays of the same values."""
    if type(one) is not type(other):
        return NotImplemented
    leaves, structure = jax.tree.flatten(one)
    other_leaves, other_structure = jax.tree.flatten(other)
    return structure == other_structure and all(map(_same, leaves, other_leaves))


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if any(isinstance(leaf, Tracer) for leaf in (one, other)):
        return False
    if isinstance(one, Array) and jnp.issubdtype(one.dtype, jax.dtypes.prng_key):
        one, other = (
            jax.random.key_data(leaf) if getattr(leaf, "dtype", None) == one.dtype else None
            for leaf in (one, other)
        )
    if not all(
        isinstance(leaf, Array | np.ndarray | np.generic | bool | int | float) for leaf in (one, other)
    ):
        return False
    first, second = np.asarray(one), np.asarray(other)
    return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()


def structure_hash(value: Any) -> int:
    """Return a hash of a pytree's structure."""
    return hash(jax.tree.structure(value))


def as_given(value: Any) -> Any:
    """Return a pytree without what was derived from the rest: None in fields whose metadata says ``derived``.

    Derived numbers depend on the processor: a rounded sum can reverse an order.
    """

    def derived(part: Any) -> dict[str, None]:
        known = fields(part) if is_dataclass(type(part)) else ()
        return {field.name: None for field in known if field.metadata.get("derived")}

    def bare(part: Any) -> Any:
        names = derived(part)
        return dataclasses.replace(part, **names) if names else part

    return jax.tree.map(bare, value, is_leaf=lambda part: bool(derived(part)))


def listing(*names: str) -> Any:
    """Return a method ``__dir__`` for completion: of our public names it lists these and fields."""

    def listed(value: Any) -> list[str]:
        if type(value).__module__.split(".")[0] != _PACKAGE:
            return list(object.__dir__(value))
        shown = {*names, *(field.name for field in fields(value))} - {"called"}
        return [name for name in object.__dir__(value) if name.startswith("_") or name in shown]

    return listed


T = TypeVar("T", bound=type)
R = TypeVar("R")


def pytree(cls: T) -> T:
    """Register a frozen dataclass as a pytree: static fields are structure, the others leaves.

    ``jax.tree_util.register_dataclass`` does the same, but structures of two of its classes compare equal if
    their static fields do (in jax 0.10 only their hashes differ). After a hash collision, a cache returns the
    program of another class: the image of another net. Here the class is compared, too.

    The ``==`` and ``hash`` of ``dataclass`` fail for arrays, and its ``repr`` prints them in full. Here
    objects are equal if their structures and the values of all arrays are equal, the hash is that of the
    structure, and the repr is one line without arrays. Methods that a class defines are kept.
    ``frozen_pytree`` generates none, since that takes a fifth of the import time.

    ``jax.export`` serializes programs with such arguments if static fields hold None, numbers, strings,
    functions of this package, or tuples of these.

    Parameters
    ----------
    cls : type
        A frozen dataclass; ``field(metadata={"static": True})`` marks fields of the structure.

    Returns
    -------
    type, ``cls``
    """
    if not isinstance(cls, type) or not hasattr(cls, "__dataclass_fields__"):
        raise TypeError(f"cls must be a frozen dataclass, got {cls!r}")
    static = [f.name for f in fields(cls) if f.metadata.get("static")]
    leaves = [f.name for f in fields(cls) if not f.metadata.get("static")]

    def choices(value: Any) -> tuple[Any, ...]:
        return (cls, *(getattr(value, name) for name in static))

    def flatten(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        return [getattr(value, name) for name in leaves], choices(value)

    def flatten_with_keys(value: Any) -> tuple[list[Any], tuple[Any, ...]]:
        keyed = [(jax.tree_util.GetAttrKey(name), getattr(value, name)) for name in leaves]
        return keyed, choices(value)

    def unflatten(aux: tuple[Any, ...], children: Any) -> Any:
        value = object.__new__(cls)
        for name, child in zip([*static, *leaves], [*aux[1:], *children], strict=True):
            object.__setattr__(value, name, child)
        return value

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    _register_serialization(cls, static)
    made: Any = cls
    if _generated(made.__eq__):
        made.__eq__, made.__hash__ = equal, structure_hash
    if _generated(made.__repr__):
        made.__repr__ = one_line
    return cls


_SERIALIZED: set[str] = set()
"""Names of classes in serialized programs."""


def _register_serialization(cls: type, static: list[str]) -> None:
    """Let ``jax.export`` write the structure as JSON, under the public name of the class.

    Private modules may move: they are not part of the name.
    """
    name = f"{cls.__module__.split('._')[0]}.{cls.__qualname__}"
    again = name in _SERIALIZED
    _SERIALIZED.add(name)

    def written(aux: tuple[Any, ...]) -> bytes:
        if again:
            raise TypeError(f"{name} cannot be serialized: there are several classes of this name")
        try:
            return json.dumps(dict(zip(static, map(_to_json, aux[1:]), strict=True))).encode()
        except TypeError as error:
            raise TypeError(f"{name} cannot be serialized: {error}") from None

    def read(text: bytes) -> tuple[Any, ...]:
        found = json.loads(bytes(text))
        if list(found) != static:
            raise ValueError(f"{name} was serialized by another version, with static fields {list(found)}")
        return (cls, *map(_of_json, found.values()))

    jax.export.register_pytree_node_serialization(
        cls,
        serialized_name=f"{name} {id(cls)}" if again else name,
        serialize_auxdata=written,
        deserialize_auxdata=read,
    )


_PACKAGE = __name__.split(".")[0]


def _to_json(value: Any) -> Any:
    if value is None or type(value) in (bool, int, float, str):
        return value
    if type(value) is tuple:
        return list(map(_to_json, value))
    module, name = getattr(value, "__module__", None) or "", getattr(value, "__qualname__", "")
    if module.split(".")[0] == _PACKAGE and getattr(importlib.import_module(module), name, None) is value:
        return {"module": module, "function": name}
    raise TypeError(
        f"static fields must contain numbers, strings, tuples or functions of {_PACKAGE}, got {value!r:.80}"
    )


def _of_json(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_of_json, value))
    if not isinstance(value, dict):
        return value
    if value["module"].split(".")[0] != _PACKAGE:
        raise ValueError(f"a serialized function must be one of {_PACKAGE}, got {value['module']}")
    return getattr(importlib.import_module(value["module"]), value["function"])


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(dataclasses.field,))
def frozen_pytree(cls: T) -> T:
    """Make a class a frozen dataclass, without the methods that ``dataclass`` generates, and a pytree."""
    return pytree(dataclasses.dataclass(frozen=True, eq=False, repr=False)(cls))


def _generated(method: Any) -> bool:
    """Return whether a method is made by ``dataclass`` or inherited from object."""
    code = getattr(method, "__code__", None)
    return code is None or code.co_filename in ("<string>", dataclasses.__file__, reprlib.__file__)


@functools.cache
def _known() -> jax.Array:
    """Return an array whose operations are traced wherever operations are traced."""
    with jax.ensure_compile_time_eval():
        return jax.device_put(np.float32(0))


def is_traced(values: Any) -> bool:
    """Return whether values, or values closed over by functions, are traced."""
    leaves = jax.tree.leaves((values, jax.lax.stop_gradient(_known())))
    cells = [cell for leaf in leaves for cell in getattr(leaf, "__closure__", None) or ()]
    leaves += jax.tree.leaves([cell.cell_contents for cell in cells])
    return any(isinstance(leaf, Tracer) for leaf in leaves)


class Compiled(Generic[R]):
    """A compiled function; see :func:`jit`."""

    def __init__(self, function: Callable[..., R], static_argnames: tuple[str, ...]) -> None:
        names = list(inspect.signature(function).parameters)
        self._dynamic = [place for place, name in enumerate(names) if name not in static_argnames]

        def with_classes(classes: str, *args: Any) -> Any:
            del classes
            return function(*args)

        static = (0, *(1 + names.index(name) for name in static_argnames))
        self._compiled = jax.jit(with_classes, static_argnums=static)
        functools.update_wrapper(self, function)

    def __call__(self, *args: Any) -> R:
        """Run the program for the classes and shapes of the arguments."""
        # Numbers, and parameters of scenes, are NumPy's: their transfer is intended.
        with jax.transfer_guard_host_to_device("allow"):
            return self._compiled(self._classes(args), *args)

    def lower(self, *args: Any) -> Any:
        """Return the program before compilation, like functions of ``jax.jit``."""
        return self._compiled.lower(self._classes(args), *args)

    def _classes(self, args: tuple[Any, ...]) -> str:
        return str(jax.tree.structure([args[place] for place in self._dynamic]))


def jit(*static_argnames: str) -> Callable[[Callable[..., R]], Compiled[R]]:
    """Decorate a function like ``jax.jit``, with the classes of all arguments in the cache key.

    JAX confuses plug-ins that are dataclasses registered with JAX (see :func:`pytree`). Arguments are
    positional-only.
    """
    return lambda function: Compiled(function, static_argnames)
