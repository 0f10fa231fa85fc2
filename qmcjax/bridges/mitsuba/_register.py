"""Registration of the plugin, and samplers for Mitsuba's dictionaries."""

from typing import Any

from qmcjax.bridges.mitsuba import _plug_in
from qmcjax.bridges.mitsuba._llvm import check_llvm, imported
from qmcjax.bridges.mitsuba._padded_pairs import PaddedPairs
from qmcjax.core import checks
from qmcjax.samplers import as_sampler

NAME = "qmcjax"
"""Name of the plugin: ``"type"`` in dictionaries."""


def register(variant: str | None = None) -> None:
    """Register the plugin ``{"type": "qmcjax"}`` with a variant of Mitsuba 3.

    Its parameters in dictionaries:

    - ``sampler``: made by :func:`held`,
    - ``film``: the same object as the sensor's film, which defines the pixels,
    - ``sample_count``: samples per pixel, 4 by default; ``mitsuba.render(spp=...)`` overrides it,
    - ``first_sample``: the index of the first sample, 0 by default,
    - ``key``: an integer, 0 by default, for requests beyond the sampler's dimensions,
    - ``block_size``: in scalar variants the integrator's, if set.

    Parameters
    ----------
    variant : str, optional
        Such as "scalar_rgb" or "llvm_ad_rgb": becomes the current variant of Mitsuba, after
        :func:`check_llvm` if it needs LLVM. By default the current variant.

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    RuntimeError
        If LLVM variants do not run here.

    Notes
    -----
    2D requests get the pairs 0 and 1, 2 and 3, ... of the sampler; 1D requests get the first coordinate of
    the next pair and then its second. The pairs beyond the sampler's are Sobol' points, scrambled and
    shuffled per pixel with one key per pair.

    In scalar variants the seed identifies the pixel: ``mitsuba.render(seed=...)`` must be 0 there. Use
    ``first_sample`` for other samples. Each thread stores 8 bytes per sample for each pair of coordinates
    that it requested, for at most 2**14 samples.

    LLVM and CUDA variants get arrays, computed in tiles of 2**14 samples: a wavefront of n samples takes 4 n
    more bytes per coordinate in use, and 32 n bytes in main memory. Seed s takes the samples from
    ``first_sample + s * sample_count`` on. Turn symbolic loops off, since they would request coordinates only
    once: ``drjit.set_flag(drjit.JitFlag.SymbolicLoops, False)``.

    Integrators must trace rays from the camera, pixel by pixel: particle tracers such as ``ptracer`` do not
    work.

    For custom loops, the plugin has ``seek(x, y, sample=0)``: the next coordinates are those of this sample
    of this pixel of the film; ``advance()`` proceeds to the pixel's next sample. In LLVM and CUDA variants
    the arguments are arrays.
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
    """Wrap a sampler for Mitsuba's dictionaries, which do not take Python objects.

    Parameters
    ----------
    sampler : Sampler, or object with the methods of one
        With two dimensions or more; 0 and 1 are the position in the pixel.

    Returns
    -------
    mitsuba.Object, for ``{"type": "qmcjax", "sampler": held(sampler), "film": film}``
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
