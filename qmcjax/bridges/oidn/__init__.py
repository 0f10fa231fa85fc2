"""The networks of Open Image Denoise as differentiable JAX functions (``pip install 'qmcjax[oidn]'``).

The package ``pyoidn`` brings the library, and in it the weights, which are read from there: of path-traced
images (the filter ``RT``) of high quality. The results are those of the library on a CPU, to 1e-5 of the
brightest value or, in images without light, to 1e-10. It divides images of more than some millions of pixels
into tiles, this module does not.
"""

from qmcjax.bridges.oidn._denoiser import Denoiser as Denoiser
from qmcjax.bridges.oidn._denoiser import denoiser as denoiser
from qmcjax.bridges.oidn._inputs import read_inputs as read_inputs
