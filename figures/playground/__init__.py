"""What the page's playground renders with: samplers and scenes as shaders, exact images, in one script."""

from figures.playground._data import COUNTS as COUNTS
from figures.playground._data import KEYS as KEYS
from figures.playground._data import SAMPLERS as SAMPLERS
from figures.playground._data import SCENES as SCENES
from figures.playground._data import START as START
from figures.playground._data import Playground as Playground
from figures.playground._data import make_sampler as make_sampler
from figures.playground._data import ours as ours
from figures.playground._data import playground as playground
