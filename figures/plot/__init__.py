"""Points, orders, images, spectra and convergence as all figures draw them: one line each in a notebook."""

from figures._rc import rc as rc
from figures.plot._convergence import convergence as convergence
from figures.plot._images import difference as difference
from figures.plot._images import image as image
from figures.plot._images import place as place
from figures.plot._images import srgb as srgb
from figures.plot._panels import order as order
from figures.plot._panels import points as points
from figures.plot._panels import spectrum as spectrum
from figures.plot._style import SAMPLERS as SAMPLERS
from figures.plot._style import Style as Style
from figures.plot._style import style as style
