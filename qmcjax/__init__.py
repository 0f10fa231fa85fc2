"""Low discrepancy samplers for rendering: generate points, and render images with them.

Four concepts, each a pure function with random access, and a JAX pytree:

- a **sequence** maps an index to a point (:mod:`qmcjax.sequences`),
- an **order** maps a pixel to a position on a curve and back (:mod:`qmcjax.orders`),
- a **sampler** maps a pixel and a sample to a point (:mod:`qmcjax.samplers`),
- a **scene** maps a point to a value (:mod:`qmcjax.scenes`);

:func:`qmcjax.render` combines them, :func:`qmcjax.integrate` averages a function over a sequence,
:mod:`qmcjax.warps` maps points to normal variates, directions and discrete choices, and
:func:`qmcjax.recommend` recommends a sampler.

Arguments known before tracing are checked: a wrong type raises a TypeError, a wrong value a ValueError. The
message names the argument, the requirement and the value. Docstrings list only other errors.
"""

import importlib
import typing

if typing.TYPE_CHECKING:
    from qmcjax import analysis as analysis
    from qmcjax import orders as orders
    from qmcjax import samplers as samplers
    from qmcjax import scenes as scenes
    from qmcjax import sequences as sequences
    from qmcjax import tracing as tracing
    from qmcjax import warps as warps
    from qmcjax.choosing import ErrorRatio as ErrorRatio
    from qmcjax.choosing import Recommendation as Recommendation
    from qmcjax.choosing import recommend as recommend
    from qmcjax.core.checkpoints import Checkpoint as Checkpoint
    from qmcjax.core.pytrees import pytree as pytree
    from qmcjax.integration import Estimate as Estimate
    from qmcjax.integration import integrate as integrate
    from qmcjax.rendering import AdaptiveImage as AdaptiveImage
    from qmcjax.rendering import Passes as Passes
    from qmcjax.rendering import boundary_gradient as boundary_gradient
    from qmcjax.rendering import estimated_reference as estimated_reference
    from qmcjax.rendering import progress_bar as progress_bar
    from qmcjax.rendering import render as render
    from qmcjax.rendering import render_adaptive as render_adaptive
    from qmcjax.rendering import render_passes as render_passes
    from qmcjax.rendering import sliding_means as sliding_means
else:
    _HOMES = {
        "qmcjax.choosing": ("ErrorRatio", "Recommendation", "recommend"),
        "qmcjax.core.checkpoints": ("Checkpoint",),
        "qmcjax.core.pytrees": ("pytree",),
        "qmcjax.integration": ("Estimate", "integrate"),
        "qmcjax.rendering": (
            "AdaptiveImage",
            "Passes",
            "boundary_gradient",
            "estimated_reference",
            "progress_bar",
            "render",
            "render_adaptive",
            "render_passes",
            "sliding_means",
        ),
    }
    _LAZY = {name: home for home, names in _HOMES.items() for name in names}
    _PACKAGES = ("analysis", "orders", "samplers", "scenes", "sequences", "tracing", "warps")

    def __getattr__(name: str) -> typing.Any:
        """Import a package or name at its first use: few scripts need all of them."""
        if name in _PACKAGES:
            return importlib.import_module(f"qmcjax.{name}")
        if name not in _LAZY:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return globals().setdefault(name, getattr(importlib.import_module(_LAZY[name]), name))

    def __dir__() -> list[str]:
        return sorted({*_PACKAGES, *_LAZY, "__version__"})


__version__ = "0.2.0"
