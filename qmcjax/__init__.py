"""Low discrepancy samplers for rendering: generate them, and make images with them.

Four nouns, each a pure function at random access and a JAX pytree:

- a **sequence** maps an index to a point (:mod:`qmcjax.sequences`),
- an **order** maps a pixel to a position on a curve and back (:mod:`qmcjax.orders`),
- a **sampler** maps a pixel and a sample to a point (:mod:`qmcjax.samplers`),
- a **scene** maps a point to a value (:mod:`qmcjax.scenes`);

:func:`qmcjax.render` puts them together, :func:`qmcjax.integrate` averages a function over a sequence alone,
:func:`qmcjax.recommend` says which sampler to take.
"""

import importlib
import typing

from qmcjax import orders as orders
from qmcjax import samplers as samplers
from qmcjax import scenes as scenes
from qmcjax import sequences as sequences
from qmcjax.choosing import ErrorRatio as ErrorRatio
from qmcjax.choosing import Recommendation as Recommendation
from qmcjax.choosing import recommend as recommend
from qmcjax.core.pytrees import pytree as pytree
from qmcjax.integrate import Estimate as Estimate
from qmcjax.integrate import integrate as integrate
from qmcjax.rendering import AdaptiveImage as AdaptiveImage
from qmcjax.rendering import Passes as Passes
from qmcjax.rendering import boundary_gradient as boundary_gradient
from qmcjax.rendering import estimated_reference as estimated_reference
from qmcjax.rendering import progress_bar as progress_bar
from qmcjax.rendering import render as render
from qmcjax.rendering import render_adaptive as render_adaptive
from qmcjax.rendering import render_layers as render_layers
from qmcjax.rendering import render_passes as render_passes
from qmcjax.rendering import sliding_means as sliding_means

if typing.TYPE_CHECKING:
    from qmcjax import tracing as tracing
else:

    def __getattr__(name: str) -> typing.Any:
        """Import what traces rays when it is asked for: half of the library, which few scenes need."""
        if name != "tracing":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return importlib.import_module("qmcjax.tracing")


__version__ = "0.2.0"
