"""Checkpoint files of long computations, from which another process resumes with bit-identical results.

A digest covers arrays, plain values, and the names of types and functions, without derived fields (see
:func:`qmcjax.core.pytrees.as_given`). Versions identify the code of
qmcjax, JAX, NumPy and SciPy (see :func:`environment`). Other code can change under its name: it is listed as
foreign and requires a label.

A file is written under a temporary name, flushed to disk and then renamed: a killed process leaves a complete
file, either the new or the previous one.
"""

import contextlib
import functools
import glob
import hashlib
import importlib.metadata
import json
import os
import platform
import signal
import socket
import sys
import threading
import time
import warnings
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Self

import jax
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.sharding import Mesh
from numpy.typing import NDArray

from qmcjax.core import checks, devices
from qmcjax.core.jax_internals import FLAGS

_ROOT = __name__.split(".")[0]
_VERSIONED = ("jax", "jaxlib", "numpy", "scipy")
_PLAIN = (bool, int, float, complex, str, bytes, range, type(None), type(Ellipsis))


def digest(name: str, value: Any) -> tuple[str, list[str]]:
    """Return 64 hexadecimal digits, equal in every process, and the foreign parts of an object.

    A tracer in the object raises a TypeError that begins with ``name``.
    """
    foreign: dict[str, None] = {}
    return _digest(value, name, foreign).hex(), list(foreign)


def environment() -> dict[str, str]:
    """Return everything that results depend on besides arguments and device."""
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


def _digest(value: Any, name: str, foreign: dict[str, None]) -> bytes:
    """Return the digest of an object, and list its foreign parts."""
    if isinstance(value, Tracer):
        raise TypeError(f"{name} must be known, got a tracer of jax.jit or another transformation")
    called, data, parts = ".".join(_path(value)), b"", []
    if type(value) in _PLAIN or isinstance(value, np.dtype):
        data = repr(value).encode()
    elif isinstance(value, np.ndarray | np.generic | Array):
        numbers: Any = value
        if jax.numpy.issubdtype(value.dtype, jax.dtypes.prng_key):
            numbers = jax.random.key_data(numbers)
        numbers = np.asarray(numbers)
        called, data = f"{value.dtype!r} {numbers.dtype!r} {numbers.shape}", numbers.tobytes()
    elif not _is_named(value):
        parts = _contents(value)
        if parts is None or not _is_named(type(value)):
            foreign[f"{name}: {called}"] = None
        if parts is None:  # A foreign pytree has arrays.
            children = jax.tree.leaves(value, is_leaf=lambda part: part is not value)
            parts = [each for each in children if each is not value]
        parts = [_digest(part, name, foreign) for part in parts]
        data = b"".join(sorted(parts) if isinstance(value, set | frozenset) else parts)
    return hashlib.sha256(f"{called}\0".encode() + data).digest()


def _contents(value: Any) -> list[Any] | None:
    """Return the contents of a container or a dataclass of a library; None for anything else."""
    if isinstance(value, dict):
        return list(value.items())
    if isinstance(value, tuple | list | set | frozenset):
        return list(value)
    if isinstance(value, slice):
        return [value.start, value.stop, value.step]
    if is_dataclass(type(value)) and _is_named(type(value)):
        return [getattr(value, each.name) for each in fields(value) if not each.metadata.get("derived")]
    return None


def _path(value: Any) -> tuple[str, str]:
    """Return the module and the name of a function or type, or else of an object's type."""
    if isinstance(value, np.ufunc):  # NumPy 2.0 and 2.1 give it no module.
        return "numpy", value.__name__
    named = value if isinstance(getattr(value, "__qualname__", None), str) else type(value)
    return str(named.__module__), named.__qualname__


def _is_named(value: Any) -> bool:
    """Return whether a library contains this object under its name."""
    module, name = _path(value)
    found: Any = sys.modules.get(module)
    for part in name.split("."):
        found = getattr(found, part, None)
    return found is value and module.split(".")[0] in (_ROOT, "builtins", *_VERSIONED)


EVERY = 30.0
"""Seconds between two writes of a state."""

SHARE = 0.05
"""Largest fraction of the time spent on writing: states of gigabytes are written less often."""

_FORMAT = "qmcjax checkpoint 1"
_HEADER = "header"

Arrays = dict[str, NDArray]


@dataclass(frozen=True)
class Checkpoint:
    """A file that keeps the state of a computation, and a label for the foreign code in it.

    Foreign code is any function, class or object from outside qmcjax, JAX, NumPy and SciPy: your own scene or
    sampler, or a function in it. Changes to this code cannot be detected.

    Parameters
    ----------
    path : str or path
        The file; it need not exist.
    label : str
        Change it whenever the foreign code, or a value that it uses, changes. A state with another label
        raises a ValueError.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import qmcjax as qj
    >>> scene = qj.scenes.function(lambda point: point[..., 0] ** 2, ("x", "y"))
    >>> sampler = qj.samplers.independent(qj.sequences.sobol(2), key=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     kept = qj.Checkpoint(Path(folder, "state"), label="squares")
    ...     print(qj.render(scene, sampler, 8, 8, spp=4, checkpoint=kept).shape)
    (8, 8)
    """

    path: str | os.PathLike[str]
    label: str


class File:
    """The state of one computation in a file, as left by an earlier run, or empty.

    Inside ``with file:``, SIGINT (Ctrl-C) and SIGTERM wait until the state is written, then take effect. A
    second signal takes effect at once. Only in the main thread, and not in jobs of several processes, which
    would wait for each other.
    """

    def __init__(self, path: Path, header: str, state: Arrays, writes: bool, alone: bool) -> None:
        self.path = path
        self.header = header
        self.state = state
        self.writes = writes
        self._alone = alone
        self._handlers: dict[int, Any] = {}
        self._signal: int | None = None
        self._saved = bool(state)
        self.outer: Arrays = {}
        """State of a loop around the one that writes; it is written with each state."""
        self._next = time.monotonic() + EVERY

    def due(self, last: bool = False) -> bool:
        """Return whether it is time to write; at the end of a computation it always is."""
        return self.writes and (last or self._signal is not None or time.monotonic() >= self._next)

    def write(self, **state: Any) -> None:
        """Replace the saved arrays, then pass on a signal that waited for it.

        If writing fails, the previous file remains, a warning is issued, and the computation continues.
        """
        start, self._saved = time.monotonic(), True
        try:
            self._write({**self.outer, **state})
        except OSError as error:
            warnings.warn(
                f"checkpoint {str(self.path)!r} cannot be written, the previous one stays: {error}",
                RuntimeWarning,
                stacklevel=2,
            )
            self._saved = False
        end = time.monotonic()
        self._next = end + max(EVERY, (end - start) / SHARE)
        if self._signal is not None:
            self.__exit__()
            self.__enter__()  # The signal may not end the computation.

    def __enter__(self) -> Self:
        if self._alone and threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) not in (None, signal.SIG_IGN):  # None: not a handler of Python.
                    self._handlers[number] = signal.signal(number, self._delay)
        return self

    def __exit__(self, error: object = None, *_: object) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers.clear()
        number, self._signal = self._signal, None
        if number is not None:
            if error is None and self._saved:
                self._say(f"checkpoint {str(self.path)!r} is saved, the same call resumes from it")
            signal.raise_signal(number)

    def _delay(self, number: int, _: object) -> None:
        first, self._signal = self._signal is None, number
        if first:
            self._say(f"saving checkpoint {str(self.path)!r} after this step (again: stop at once)")
        else:
            self.__exit__(KeyboardInterrupt)

    def _say(self, text: str) -> None:
        with contextlib.suppress(RuntimeError):  # The signal may have interrupted another print.
            print(f"interrupted: {text}", file=sys.stderr, flush=True)

    def _write(self, state: Mapping[str, Any]) -> None:
        temporary = self.path.with_name(f"{_prefix(self.path)}{os.getpid()}-{socket.gethostname()}")
        try:
            with open(temporary, "wb") as file:
                np.savez(file, **{_HEADER: np.array(self.header)}, **state)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, self.path)
        finally:
            temporary.unlink(missing_ok=True)


def begin(checkpoint: Any, mesh: Mesh | None = None, **made_of: Any) -> File:
    """Return the file of a computation, with the state saved by an earlier run.

    ``mesh``: all its processes read the file; the first one writes it when it is due. ``**made_of``: all
    arguments that the result depends on, by name. Raises an OSError if the file cannot be written.
    """
    path, label = _checked(checkpoint)
    described, foreign = {"label": repr(label), "device": devices.kind(mesh)}, []
    for name, value in made_of.items():
        described[name] = repr(value)
        if not isinstance(value, int | float | str):
            found, more = digest(name, value)
            described[name], foreign = f"sha256 {found}", foreign + more
    if foreign and label is None:
        raise ValueError(
            "checkpoint must be a qmcjax.Checkpoint with a label where foreign code takes part, got "
            f"{str(path)!r} and {', '.join(foreign[:3])}: give Checkpoint(path, label), and another label "
            "whenever that code changes"
        )
    described |= environment()
    writes, state = devices.is_first(mesh), {}
    if writes:
        for part in path.parent.glob(f"{glob.escape(_prefix(path))}*"):
            part.unlink(missing_ok=True)  # Of a killed process; a running one fails to write once.
    if path.exists():
        known, state = _read(path)
        _refuse_other(path, known, described)
    header = json.dumps({"format": _FORMAT, "made of": described})
    made = File(path, header, state, writes, devices.processes(mesh) == 1)
    if writes and not state:
        made._write({})
    if not devices.agree(int(digest("checkpoint", state)[0][:8], 16), mesh):
        raise ValueError(
            f"checkpoint must be a file that all processes of the mesh see, got {str(path)!r}, which is not "
            "the same for all"
        )
    return made


def _checked(checkpoint: Any) -> tuple[Path, str | None]:
    """Return the path and the label of a checkpoint, or raise a TypeError or ValueError."""
    path, label = checkpoint, None
    if isinstance(checkpoint, Checkpoint):
        path, label = checkpoint.path, checkpoint.label
        if not isinstance(label, str):
            raise TypeError(f"checkpoint must have a string as label, got {checks.shown(label)}")
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"checkpoint must be the path of a file or a Checkpoint, got {checks.shown(path)}")
    path = Path(os.fsdecode(path))
    if path.is_dir() or not path.parent.is_dir():
        wrong = "a folder" if path.is_dir() else "one in a folder that is not there"
        raise ValueError(f"checkpoint must be the path of a file, got {wrong}: {str(path)!r}")
    return path, label


def _prefix(path: Path) -> str:
    return f".{path.name}.part-"


def _read(path: Path) -> tuple[dict[str, str], Arrays]:
    try:
        # Each array is stored with a checksum, which is verified.
        with open(path, "rb") as opened, np.load(opened, allow_pickle=False) as file:
            header = json.loads(str(file[_HEADER]))
            state = {name: file[name] for name in file.files if name != _HEADER}
        if header["format"] != _FORMAT:
            raise ValueError(f"its format is {header['format']!r}")
        return header["made of"], state
    except (OSError, ValueError, KeyError, TypeError, EOFError, AttributeError, zipfile.BadZipFile) as error:
        raise ValueError(
            f"checkpoint must be a checkpoint file, got {str(path)!r}, which is damaged or "
            f"something else ({error}): give another path, or delete it to begin anew"
        ) from None


def _refuse_other(path: Path, known: Mapping[str, str], wanted: Mapping[str, str]) -> None:
    """Raise a ValueError that names the differences."""
    differences = []
    for name in {**known, **wanted}:
        old, new = known.get(name), wanted.get(name)
        if old != new:
            plain = not any(str(each).startswith("sha256 ") for each in (old, new))
            differences.append(f"{name} was {old}, is {new}" if plain else f"{name} is another one")
    if differences:
        raise ValueError(
            f"checkpoint must belong to this computation, got {str(path)!r}, where {', '.join(differences)}"
            ": give another path, or delete it to begin anew"
        )
