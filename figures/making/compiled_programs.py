"""JAX's cache of compiled programs: compiling takes most of the time of drafts.

JAX identifies programs by what they compute, its version and its options. The environment must name the
folder before JAX is imported. A program counts as used when it is read, if the file system records that.
"""

import glob
import hashlib
import importlib.metadata
import os
import platform
import re
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from figures.making import store
from figures.making.this_machine import features

MOST = 2**30
"""Bytes to keep; with JAX's own limit, each new program would cost a scan of the folder."""

FOLDER, SWITCH = "JAX_COMPILATION_CACHE_DIR", "JAX_ENABLE_COMPILATION_CACHE"
ALL = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0", "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1"}
"""Figures consist of many small programs; reading one takes a tenth of the time of compiling it."""

QUICK = (
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_backend_optimization_level=1",
    "--xla_llvm_disable_expensive_passes=true",
)
"""XLA's former CPU loop emitters and fewer LLVM passes: two thirds of the compile time, slower programs."""

QUICK_OF = "0.10."
"""Versions of jaxlib that have these flags: XLA aborts a process that passes an unknown one."""

UNREADABLE = re.compile(r"Error reading persistent compilation cache entry for '([^']+)'")
UNWRITABLE = "Error writing persistent compilation cache entry"


def keep(warn: Callable[[str], None]) -> None:
    """Make processes that start from now on use the cache.

    A folder already named by the environment is used. If no folder can be written, ``warn`` and continue.
    """
    if os.environ.get(FOLDER):
        return
    try:
        folder = place()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)  # Code from this folder is executed.
        store.prepare(folder)
    except (OSError, RuntimeError) as error:
        warn(f"compiled programs cannot be kept, and the next run compiles them again: {error}")
        return
    _forget(folder.parent)
    os.environ[FOLDER] = str(folder)
    for name, value in ALL.items():
        os.environ.setdefault(name, value)


def place() -> Path:
    """Return the folder for this kind of processor, in the user's cache folder.

    Raises RuntimeError if the user's home is unknown.
    """
    named = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(named):  # The specification ignores relative paths.
        caches = Path(named)
    elif sys.platform == "win32":
        caches = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    else:
        caches = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    # Machines that share a home may have different instruction sets.
    kind = hashlib.sha256(f"{platform.machine()} {features()}".encode()).hexdigest()[:12]
    return caches / "qmcjax" / "programs" / kind


def _forget(folder: Path, most: int = MOST) -> None:
    """Remove the least recently used programs until the others fit into ``most`` bytes."""
    entries = []
    for path in folder.rglob("*-cache"):
        with suppress(OSError):  # Another process may remove them.
            status = path.stat()
            entries.append((max(status.st_atime, status.st_mtime), status.st_size, path))
    for _, size, path in sorted(entries, reverse=True):
        most -= size
        if most < 0:
            with suppress(OSError):
                path.unlink()


def quickly() -> None:
    """Make processes that start from now on compile faster, for slower programs: right for small images."""
    flags = os.environ.get("XLA_FLAGS", "")
    if importlib.metadata.version("jaxlib").startswith(QUICK_OF):
        wanted = [flag for flag in QUICK if flag.partition("=")[0] not in flags]
        os.environ["XLA_FLAGS"] = " ".join([*flags.split(), *wanted])


def measure_without() -> None:
    """Disable the cache in this process and those that it starts, where compile time is measured."""
    os.environ[SWITCH] = "0"
    jax = sys.modules.get("jax")
    if jax is not None and jax.config.jax_enable_compilation_cache:
        from jax.experimental.compilation_cache import compilation_cache

        jax.config.update("jax_enable_compilation_cache", False)
        compilation_cache.reset_cache()  # It checks only once whether it is enabled.


def heal() -> None:
    """Remove programs that cannot be read, and warn only once if programs cannot be written.

    Files are truncated if a process is killed while JAX writes. JAX then warns and compiles again, but writes
    the program only if there is no file.
    """
    show, full = warnings.showwarning, False

    def hear(message, *where, **more):
        nonlocal full
        unreadable, unwritable = UNREADABLE.search(str(message)), str(message).startswith(UNWRITABLE)
        if unreadable:
            for path in Path(os.environ.get(FOLDER, "")).glob(f"{glob.escape(unreadable[1])}-*-cache"):
                path.unlink(missing_ok=True)
        elif not (full and unwritable):
            full = full or unwritable
            show(message, *where, **more)

    warnings.showwarning = hear
