"""Samplers: from a pixel and a sample to a point of a sequence.

Every sampler is called with ``(x, y, sample, dims)``, by default for all dimensions. Coordinates 0 and 1 are
the position inside the pixel (x, y), the rest are the scene's, in the order of ``scene.needs``.
"""

from qmcjax.samplers._along_curve import contiguous as contiguous
from qmcjax.samplers._along_curve import segments as segments
from qmcjax.samplers._base import Fits as Fits
from qmcjax.samplers._base import Sampler as Sampler
from qmcjax.samplers._dither import Ranked as Ranked
from qmcjax.samplers._dither import blue_noise_mask as blue_noise_mask
from qmcjax.samplers._dither import dither as dither
from qmcjax.samplers._dither import ranked as ranked
from qmcjax.samplers._full_screen import full_screen as full_screen
from qmcjax.samplers._independent import independent as independent
from qmcjax.samplers._independent import interleaved as interleaved
from qmcjax.samplers._of_functions import Randomized as Randomized
from qmcjax.samplers._of_functions import SamplerLike as SamplerLike
from qmcjax.samplers._of_functions import as_sampler as as_sampler
from qmcjax.samplers._of_functions import function as function
from qmcjax.samplers._of_functions import randomized as randomized
from qmcjax.samplers._optimized import optimized as optimized
from qmcjax.samplers._padded_replications import padded_replications as padded_replications
from qmcjax.samplers._partitioned import partitioned as partitioned
from qmcjax.samplers._partitioned import shifted as shifted
from qmcjax.samplers._progressive import Progressive as Progressive
from qmcjax.samplers._progressive import progressive as progressive
from qmcjax.samplers._tiled import Tiled as Tiled
from qmcjax.samplers._tiled import designed as designed
from qmcjax.samplers._tiled import tiled as tiled
from qmcjax.samplers._window_lattice import WindowLattice as WindowLattice
from qmcjax.samplers._window_lattice import window_lattice as window_lattice
from qmcjax.samplers._z import z as z
