"""Registration of the plugin, samplers for Mitsuba's dictionaries, and a check of LLVM."""

import glob
import subprocess
import sys
from types import ModuleType
from typing import Any

from qmcjax.bridges.mitsuba._given import as_pixels, of_size
from qmcjax.bridges.mitsuba._scalar import scalar
from qmcjax.bridges.mitsuba._vectorized import vectorized
from qmcjax.core import checks

_TRIAL = """
import drjit, mitsuba
mitsuba.set_variant("llvm_ad_rgb")
print(*drjit.detail.llvm_version(), sep=".", flush=True)
film = {"type": "hdrfilm", "width": 2, "height": 2}
scene = {
    "type": "scene",
    "integrator": {"type": "direct"},
    "sensor": {"type": "perspective", "film": film},
    "ball": {"type": "sphere"},
    "sky": {"type": "constant"},
}
drjit.eval(mitsuba.render(mitsuba.load_dict(scene), spp=1))
drjit.sync_thread()
"""


def check_llvm() -> str:
    """Return the version of LLVM that Mitsuba finds; raise unless its LLVM variants render with it.

    Some versions abort the whole process at the first image: LLVM 14 to 16 did; 19 works. So this renders
    four pixels in a separate process, which takes a second or two. Of several, Dr.Jit takes libLLVM.so where
    the system looks for libraries, otherwise the last by name of those that Debian installs.

    Returns
    -------
    str, such as "19.1.7"

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    RuntimeError
        If there is no LLVM, or it does not work.
    """
    import_mitsuba()
    trial = subprocess.run([sys.executable, "-c", _TRIAL], capture_output=True, text=True)
    version = trial.stdout.strip()
    if trial.returncode:
        found = f"LLVM {version} aborts" if version else "no LLVM is found"
        last = (trial.stderr.strip().splitlines() or [""])[-1]
        path = max(glob.glob("/usr/lib/*/libLLVM.so.19*"), default="the path of libLLVM.so")
        raise RuntimeError(
            f"{found} (code {trial.returncode}: {last}). Mitsuba's LLVM variants need LLVM 19 (Debian: "
            f"libllvm19); before Mitsuba is imported, set DRJIT_LIBLLVM_PATH to {path} if there are several"
        )
    return version


def import_mitsuba() -> ModuleType:
    """Return Mitsuba, or raise an ImportError with installation instructions."""
    try:
        import mitsuba  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError("Mitsuba 3 is not installed: pip install 'qmcjax[mitsuba]'") from error
    return mitsuba


NAME = "qmcjax"
"""Name of the plugin: ``"type"`` in dictionaries."""


def register(variant: str | None = None) -> None:
    """Register the plugin ``{"type": "qmcjax"}`` with a variant of Mitsuba 3.

    Its parameters in dictionaries:

    - ``sampler``: made by :func:`wrap`,
    - ``film``: the same object as the sensor's film, which defines the pixels,
    - ``sample_count``: samples per pixel, 4 by default; ``mitsuba.render(spp=...)`` overrides it,
    - ``first_sample``: the index of the first sample, 0 by default,
    - ``key``: an integer, 0 by default, for requests beyond the sampler's dimensions,
    - ``block_size``: in scalar variants the integrator's, if set.

    Parameters
    ----------
    variant : str, optional
        Such as "scalar_rgb" or "llvm_ad_rgb". It becomes the current variant of Mitsuba, after
        :func:`check_llvm` if it needs LLVM. By default the current variant.

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    RuntimeError
        If LLVM variants do not run here.

    Notes
    -----
    2D requests return the pairs 0 and 1, 2 and 3, ... of the sampler; 1D requests return the first coordinate
    of the next pair. Pairs beyond those of the sampler are Sobol' points, scrambled and shuffled per pixel
    with one key per pair.

    In scalar variants the seed identifies the pixel, so ``mitsuba.render(seed=...)`` must be 0. Use
    ``first_sample`` for other samples. Python returns the samples one by one, so that images take 5 to 20
    times as long as with Mitsuba's samplers: prefer LLVM or CUDA variants.

    In LLVM and CUDA variants Dr.Jit compiles the operations of the sampler, in symbolic and evaluated loops.
    Seed s takes the samples from ``first_sample + s * sample_count`` on. Particle tracers such as ``ptracer``
    work only in these variants: in scalar variants their requests do not belong to a pixel.

    For custom loops, the plugin has ``seek(x, y, sample=0)``: the next coordinates are those of this sample
    of this pixel of the film; ``advance()`` proceeds to the next sample of the pixel. In LLVM and CUDA
    variants the arguments are arrays.
    """
    mitsuba = import_mitsuba()
    if variant is not None:
        if not isinstance(variant, str):
            raise TypeError(f"variant must be the name of a variant, got {checks.shown(variant)}")
        checks.choice("variant", variant, mitsuba.variants())
        if variant.startswith("llvm"):
            check_llvm()
        mitsuba.set_variant(variant)
    if mitsuba.variant() is None:
        raise ValueError(f"variant must be one of {tuple(mitsuba.variants())} if none is set, got None")
    of_variant = scalar if mitsuba.variant().startswith("scalar") else vectorized
    mitsuba.register_sampler(NAME, of_variant(mitsuba))


def wrap(sampler: Any) -> Any:
    """Wrap a sampler for Mitsuba's dictionaries, which do not take Python objects.

    Parameters
    ----------
    sampler : Sampler, object with the methods of one, or function
        With two dimensions or more; 0 and 1 are the position in the pixel. A function of
        ``(width, height, spp)`` that returns such a sampler is called with the size of the film and the
        number of samples per pixel.

    Returns
    -------
    mitsuba.Object, for ``{"type": "qmcjax", "sampler": wrap(sampler), "film": film}``
    """
    mitsuba = import_mitsuba()
    if not of_size(sampler):
        sampler = as_pixels("sampler", sampler)

    class Wrapped(mitsuba.Object):
        def __init__(self) -> None:
            super().__init__()
            self.wrapped = sampler

        def to_string(self) -> str:
            return checks.shown(sampler)

    return Wrapped()
