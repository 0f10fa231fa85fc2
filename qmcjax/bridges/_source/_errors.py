"""Errors that name the untranslatable line of a sampler."""

import sysconfig
import traceback
from collections.abc import Iterable
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeAlias

import jax

import qmcjax

_HERE = Path(__file__).parent
_JAX = Path(jax.__file__).parent
_QMCJAX = Path(qmcjax.__file__).parent
_PYTHON = Path(sysconfig.get_path("stdlib"))

Origin: TypeAlias = tuple[Any, "Origin"] | None
"""The origin of a value: the source information of an equation, and of the call around it."""


class Untranslatable(Exception):
    """An operation that cannot be translated, with an explanation."""


def source_line(origin: Origin) -> str:
    """Return the innermost line of a user's file that made an operation, otherwise of a library file.

    JAX ends the lines of an equation at the function that it traced: those of the call come next.
    """
    frames: list[_Frame] = []
    while origin is not None:
        info, origin = origin
        found = getattr(info, "traceback", None)
        frames += [(f.file_name, f.line_num, f.function_name) for f in getattr(found, "frames", ())]
    return _best(frames)


_Frame: TypeAlias = tuple[str, int | None, str]


def _best(frames: Iterable[_Frame]) -> str:
    """Return the line of the highest rank, the innermost of several; frames come innermost first."""
    rank, file, number, name = max(((_rank(f[0]), *f) for f in frames), key=itemgetter(0), default=(0,) * 4)
    return f"at {file}:{number} ({name})" if rank else "at an unknown line"


def _rank(file: str) -> int:
    """Return 3 for a user's file, 2 for one of qmcjax, 1 for other packages, 0 for those between."""
    path = Path(file)
    if path.is_relative_to(_JAX) or path.is_relative_to(_HERE) or file.startswith("<frozen"):
        return 0
    if path.is_relative_to(_QMCJAX):
        return 2
    installed = path.is_relative_to(_PYTHON) or not {"site-packages", "dist-packages"}.isdisjoint(path.parts)
    return 1 if installed else 3


_SHAPE = "has a shape that depends on values: shapes must be the same for all points"
_REASONS = {
    jax.errors.TracerArrayConversionError: "calls NumPy on a value that varies: use jax.numpy",
    jax.errors.TracerBoolConversionError: "branches on a value that varies: use jax.numpy.where",
    jax.errors.TracerIntegerConversionError: "uses a value that varies as a Python integer: use jax.numpy",
    jax.errors.NonConcreteBooleanIndexError: _SHAPE,
    jax.errors.ConcretizationTypeError: (
        "needs a number that varies: Python's int and float, and shapes, must not depend on values"
    ),
    jax.errors.UnexpectedTracerError: "keeps a value from an earlier call",
}


def refused(error: Exception) -> ValueError | None:
    """Return the error for a function that JAX cannot trace, or None for other errors."""
    reason = next((text for kind, text in _REASONS.items() if isinstance(error, kind)), None)
    first = str(error).partition("\n")[0]
    if isinstance(error, TypeError) and first.startswith("Shapes must be 1D sequences of concrete values"):
        reason = _SHAPE
    if reason is None:
        return None
    frames = reversed(traceback.extract_tb(error.__traceback__))
    line = _best((frame.filename, frame.lineno, frame.name) for frame in frames)
    return ValueError(f"sampler {reason}, {line}: {first}")


ADVICE = {
    **dict.fromkeys(
        ("pure_callback", "io_callback", "debug_callback", "debug_print"),
        "it calls Python: write the function with jax.numpy, and take prints out",
    ),
    **dict.fromkeys(
        ("sort", "argsort", "argmax", "argmin", "top_k"),
        "sort constants with NumPy when the sampler is made, or compare values one by one",
    ),
}
"""Replacements for operations that users may mistake for arithmetic."""
