"""Low discrepancy samplers for rendering: generate them, and make images with them.

Four nouns, each a pure function at random access and a JAX pytree:

- a **sequence** maps an index to a point (:mod:`qmcjax.sequences`),
- an **order** maps a pixel to a position on a curve and back (:mod:`qmcjax.orders`),
- a **sampler** maps a pixel and a sample to a point (:mod:`qmcjax.samplers`),
- a **scene** maps a point to a value (:mod:`qmcjax.scenes`);

:func:`qmcjax.render` puts them together, :func:`qmcjax.integrate` averages a function over a sequence alone.
"""

from qmcjax import orders as orders
from qmcjax import samplers as samplers
from qmcjax import scenes as scenes
from qmcjax import sequences as sequences
from qmcjax.boundary import boundary_gradient as boundary_gradient
from qmcjax.integrate import integrate as integrate
from qmcjax.layers import render_layers as render_layers
from qmcjax.passes import render_passes as render_passes
from qmcjax.render import AdaptiveImage as AdaptiveImage
from qmcjax.render import render as render

__version__ = "0.1.0"
