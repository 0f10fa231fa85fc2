"""What makes the plug-in known, and what dictionaries take."""

from typing import Any

from qmcjax.bridges.mitsuba import _plug_in
from qmcjax.bridges.mitsuba._llvm import check_llvm, imported
from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs
from qmcjax.core import checks
from qmcjax.samplers import as_sampler

NAME = "qmcjax"
"""Of the plug-in: ``"type"`` in dictionaries."""


def register(variant: str | None = None) -> None:
    """Make the plug-in ``{"type": "qmcjax"}`` known to a variant of Mitsuba 3.

    What it is given in dictionaries:

    - ``sampler``: made by :func:`held`,
    - ``film``: the very object that the sensor has, which says what the pixels are,
    - ``sample_count``: samples of a pixel, by default 4; ``mitsuba.render(spp=...)`` goes before,
    - ``first_sample``: the number of the first of them, by default 0,
    - ``key``: an integer, by default 0, for what the integrator asks for beyond the sampler's dimensions,
    - ``block_size``: in scalar variants that of the integrator, if it was given one.

    Parameters
    ----------
    variant : str, optional
        Such as "scalar_rgb" or "llvm_ad_rgb": it is set as Mitsuba's variant, after :func:`check_llvm` if it
        needs LLVM. By default the one that is set already.

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    TypeError
        If ``variant`` is no word.
    ValueError
        If Mitsuba has no such variant, or none is set.
    RuntimeError
        If LLVM variants do not run here.

    Notes
    -----
    Requests for two coordinates get the pairs 0 and 1, 2 and 3, ... of the sampler, those for one the next
    such pair's first coordinate and then its second. The pairs beyond the sampler's are Sobol' points,
    scrambled and shuffled by pixels, with a fresh key each.

    In scalar variants a pixel is told by its seed: ``mitsuba.render(seed=...)`` must be 0 there. Other
    samples are had by ``first_sample``. Each thread keeps 8 bytes a sample for each pair of coordinates that
    it was asked for, of at most 2**14 samples.

    In LLVM and CUDA variants arrays are handed out, made in tiles of 2**14 samples: to a wavefront of n
    samples they add 4 n bytes for each coordinate that is in use, and 32 n bytes in main memory. Seed s takes
    the samples from ``first_sample + s * sample_count`` on. Symbolic loops must be off, since they would ask
    but once: ``drjit.set_flag(drjit.JitFlag.SymbolicLoops, False)``.

    Integrators are to follow rays from the camera, pixel by pixel: particle tracers have no pixel to tell.

    The plug-in also has ``seek(x, y, sample=0)``, for loops of one's own: the next coordinates are those of
    this sample of this pixel of the film, and ``advance()`` goes to the pixel's next one. In LLVM and CUDA
    variants these are arrays.
    """
    mitsuba = imported()
    if variant is not None:
        if not isinstance(variant, str):
            raise TypeError(f"variant must be the name of a variant, got {checks.shown(variant)}")
        checks.choice("variant", variant, mitsuba.variants())
        if variant.startswith("llvm"):
            check_llvm()
        mitsuba.set_variant(variant)
    if mitsuba.variant() is None:
        raise ValueError(f"variant must be one of {tuple(mitsuba.variants())} if none is set, got None")
    scalar = mitsuba.variant().startswith("scalar")
    of_variant = _plug_in.scalar if scalar else _plug_in.vectorized
    mitsuba.register_sampler(NAME, of_variant(mitsuba))


def held(sampler: Any) -> Any:
    """Return a sampler as Mitsuba's dictionaries take it: they have no room for objects of Python.

    Parameters
    ----------
    sampler : Sampler, or object with the methods of one
        One with two dimensions or more; 0 and 1 are the position in the pixel.

    Returns
    -------
    mitsuba.Object
        For ``{"type": "qmcjax", "sampler": held(sampler), "film": film}``.
    """
    mitsuba = imported()
    sampler = as_sampler("sampler", sampler)
    PaddedPairs(sampler, 0)

    class Held(mitsuba.Object):
        """A sampler, opaque to Mitsuba."""

        def __init__(self) -> None:
            super().__init__()
            self.held = sampler

    return Held()
