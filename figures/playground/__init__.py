"""What the page's playground renders with: samplers and scenes as shaders, exact images, in one script."""

from figures.playground._data import KEYS as KEYS
from figures.playground._data import Playground as Playground
from figures.playground._data import playground as playground
from figures.playground._ours import COUNTS as COUNTS
from figures.playground._ours import SAMPLERS as SAMPLERS
from figures.playground._ours import SCENES as SCENES
from figures.playground._ours import made as made
from figures.playground._ours import ours as ours
