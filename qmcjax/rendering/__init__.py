"""Rendering: images from scenes and samplers, with their errors and derivatives."""

from qmcjax.rendering._adaptive import AdaptiveImage as AdaptiveImage
from qmcjax.rendering._boundary import boundary_gradient as boundary_gradient
from qmcjax.rendering._motion_blur import sliding_means as sliding_means
from qmcjax.rendering._passes import Passes as Passes
from qmcjax.rendering._passes import estimated_reference as estimated_reference
from qmcjax.rendering._passes import render_passes as render_passes
from qmcjax.rendering._render import render as render
from qmcjax.rendering._render_adaptive import render_adaptive as render_adaptive
from qmcjax.rendering._task import progress_bar as progress_bar
