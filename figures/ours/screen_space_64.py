"""All screen-space methods at 64 samples a pixel: pictures of their errors."""

from functools import partial

from figures.shared.screen_space import pictures

make = partial(pictures, 64)
