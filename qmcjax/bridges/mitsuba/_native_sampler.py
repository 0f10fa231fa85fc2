"""Samplers of scalar variants without Python: functions and a plugin, compiled by the system's compiler."""

import ctypes
import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Sequence
from functools import cache, lru_cache
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import numpy as np

from qmcjax.bridges._padding import PaddedPairs
from qmcjax.bridges._source import source
from qmcjax.bridges._source._seeds import Seeded
from qmcjax.bridges.mitsuba._streams import Blocks
from qmcjax.samplers import Sampler

PACKAGES = "Debian: apt install g++; macOS: xcode-select --install"
"""What compilers are in."""

_LOCK = Lock()


class NotCompiled(Exception):
    """The reason that there is no library, and a remedy."""


@cache
def compiler(language: str) -> str:
    """Return the compiler of a language: CC or CXX of the environment, else cc or c++; raise NotCompiled."""
    variable, usual = {"c": ("CC", "cc"), "c++": ("CXX", "c++")}[language]
    command = os.environ.get(variable) or usual
    found = shutil.which(command)
    if found is None:
        raise NotCompiled(f"there is no compiler {command!r} ({PACKAGES})")
    return found


def library(text: str, language: str, flags: Sequence[str] = (), linked: Sequence[str] = ()) -> ctypes.CDLL:
    """Return the library of source code with others linked to it, compiled if it is not cached.

    Raises NotCompiled if there is no compiler, if it fails, or if there is no folder for its result.
    """
    command = [compiler(language), "-O2", "-shared", "-fPIC", *flags, "-x", language, "-"]
    command += ["-x", "none", *linked, "-lm"]
    made_of = repr((command, _version(command[0]), text))
    with _LOCK:  # Threads of Mitsuba ask for the same library at once.
        try:
            path = _folder() / f"{hashlib.sha256(made_of.encode()).hexdigest()}.so"
            if not path.exists():
                _compile(command, text, path)
            return ctypes.CDLL(str(path))
        except OSError as error:
            raise NotCompiled(
                f"the library of compiled functions cannot be kept or loaded: {error}"
            ) from error


def _compile(command: Sequence[str], text: str, path: Path) -> None:
    handle, temporary = tempfile.mkstemp(suffix=".so", dir=path.parent)
    os.close(handle)
    try:
        done = subprocess.run([*command, "-o", temporary], input=text, capture_output=True, text=True)
        if done.returncode:
            first = next((line for line in done.stderr.splitlines() if "error" in line), "")
            raise NotCompiled(f"{command[0]} ended with {done.returncode}: {first}")
        os.replace(temporary, path)
    finally:
        Path(temporary).unlink(missing_ok=True)


@cache
def _version(command: str) -> str:
    """Return the version text of a compiler; another one compiles again."""
    return subprocess.run([command, "--version"], capture_output=True, text=True).stdout


def _folder() -> Path:
    """Return the folder for libraries, below the user's folder for what can be made again."""
    named = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(named):  # The specification has others ignored.
        caches = Path(named)
    else:
        caches = Path(os.path.expanduser("~")) / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    folder = caches / "qmcjax" / "mitsuba"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # Private: its libraries are executed.
    return folder


NAME = "qmcjax_native"
"""Name of the compiled plugin."""

_SPECTRA = {
    "scalar_rgb": "mitsuba::Color<float, 3>",
    "scalar_spectral": "mitsuba::Spectrum<float, 4>",
    "scalar_spectral_polarized": "mitsuba::MuellerMatrix<mitsuba::Spectrum<float, 4>>",
}

_FUNCTIONS = """
uint32_t of_task_bytes(void) { return (uint32_t)sizeof(own_pixel); }

void of_task_prepare(uint32_t x, uint32_t y, const uint32_t *seeds, own_pixel *pixel) {
    *pixel = own_prepare(x, y, seeds);
}

void of_task_sample(const own_pixel *pixel, uint32_t number, const uint32_t *seeds, float *coordinates) {
    own_sample(*pixel, number, seeds, coordinates);
}

void of_task_pair(const own_pixel *pixel, uint32_t pair, uint32_t number, const uint32_t *seeds, float *two) {
    own_pair(*pixel, pair, number, seeds, two);
}
"""


class Task(ctypes.Structure):
    """The data passed to the plugin, with the same members as in its source code."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("prepare", "sample", "pair", "seeds", "corners")),
        *(
            (name, ctypes.c_uint32)
            for name in ("pixel_bytes", "dims", "blocks", "side", "width", "height", "left", "top", "first")
        ),
    )


class _ButForSeeds:
    """A sampler, equal to those that differ only in the values of their seeds."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler, seeded = sampler, Seeded.of(sampler)
        self._equal = seeded.tree, tuple(seeded.named()), tuple(seeded.constants)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ButForSeeds) and self._equal == other._equal

    def __hash__(self) -> int:
        return hash(self._equal)


@lru_cache(maxsize=8)
def _text(of: _ButForSeeds) -> str:
    """Return the functions of a sampler: once for all passes of an image, which have keys of their own."""
    sampler = of.sampler
    text = source(sampler, tuple(range(sampler.dims - sampler.dims % 2)), "c", "own")
    # Seeds are arguments: without theirs, the text of samplers with other keys is the same.
    start = text.index("static const uint32_t own_seeds[")
    return text[:start] + text[text.index("};\n", start) + 3 :] + _FUNCTIONS


class Functions:
    def __init__(self, sampler: Sampler, padding: np.ndarray) -> None:
        self.sampler, self.dims = sampler, sampler.dims - sampler.dims % 2
        self.library = library(_text(_ButForSeeds(sampler)), "c")
        self.seeds = np.concatenate([Seeded.of(sampler).words(), np.asarray(padding, np.uint32)])

    def task(self, blocks: Blocks, first: int) -> tuple[Task, Any]:
        """Return the task of an image, and the arrays that it refers to."""
        corners, window = blocks.corners.astype(np.uint32), blocks.window

        def address(name: str) -> int | None:
            return ctypes.cast(self.library[f"of_task_{name}"], ctypes.c_void_p).value

        task = Task(
            **{name: address(name) for name in ("prepare", "sample", "pair")},
            seeds=self.seeds.ctypes.data,
            corners=corners.ctypes.data,
            pixel_bytes=self.library.of_task_bytes(),
            dims=self.dims,
            blocks=len(corners),
            side=blocks.side,
            width=window.width,
            height=window.height,
            left=window.left,
            top=window.top,
            first=first,
        )
        return task, (self, corners)


class Numbers:
    """The coordinates of a sampler, by JAX or by compiled functions; shared by copies of the plugin."""

    def __init__(self, sampler: Sampler, key: Any) -> None:
        self.pairs = PaddedPairs(sampler, key)
        self._lock = Lock()
        self._functions: Functions | None = None
        self._tried = False
        self._image: Any = None

    def native(self, mitsuba: ModuleType, blocks: Blocks, first: int, count: int) -> Any:
        """Return a sampler of the compiled plugin, or None if there are no compiled functions."""
        with self._lock:
            if not self._tried:
                self._functions, self._tried = self._compile_functions(), True
            if self._functions is None:
                return None
            if self._image is None or self._image[0] is not blocks:
                self._image = blocks, owner(mitsuba, self._functions.task(blocks, first))
            made = self._image[1]
        properties = mitsuba.Properties(NAME)
        properties["owner"], properties["task"] = made, ctypes.addressof(made.kept[0])
        properties["sample_count"] = count
        return mitsuba.PluginManager.instance().create_object(properties)

    def _compile_functions(self) -> Functions | None:
        try:
            return Functions(self.pairs.sampler, np.asarray(self.pairs.words))
        except (NotCompiled, ValueError) as error:
            slow(str(error))
            return None


def owner(mitsuba: ModuleType, kept: Any) -> Any:
    """Return a Mitsuba object that keeps alive what compiled samplers refer to."""

    class Owner(mitsuba.Object):
        def __init__(self) -> None:
            super().__init__()
            self.kept = kept

    return Owner()


@cache
def register_native(variant: str) -> bool:
    """Register the compiled plugin with a scalar variant, or warn why not and return False."""
    try:
        if variant not in _SPECTRA:
            raise NotCompiled(f"the plugin is made for {', '.join(_SPECTRA)}, not for {variant}")
        library(*_plugin(variant)).qmcjax_register(NAME.encode())
    except NotCompiled as error:
        slow(str(error))
        return False
    return True


@cache
def slow(reason: str) -> None:
    """Warn why Python computes the samples, once for each reason."""
    warnings.warn(
        f"samples of qmcjax come from Python, which takes 5 to 30 times as long: {reason}",
        RuntimeWarning,
        stacklevel=2,
    )


def _plugin(variant: str) -> tuple[str, str, list[str], list[str]]:
    """Return source code, language and flags of the plugin, and the libraries that it needs."""
    found = {name: importlib.util.find_spec(name) for name in ("mitsuba", "drjit", "nanobind")}
    missing = [name for name, spec in found.items() if spec is None or spec.origin is None]
    if missing:
        raise NotCompiled(f"headers of {', '.join(missing)} are missing (pip install {' '.join(missing)})")
    folders = {name: Path(str(spec.origin)).parent for name, spec in found.items() if spec is not None}
    own = Path(str(files("qmcjax.bridges.mitsuba") / "_native"))
    flags = ["-std=c++17", f"-DSPECTRUM={_SPECTRA[variant]}", f"-I{own}"]
    flags += [f"-I{folder / 'include'}" for folder in folders.values()]
    # Another version is compiled again.
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in folders)
    text = (own / "sampler.cpp").read_text(encoding="utf-8")
    linked = next(folders["mitsuba"].glob("libmitsuba.*"))
    return f"// For {versions}.\n{text}", "c++", flags, [str(linked)]
