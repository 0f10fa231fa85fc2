"""All screen-space methods at 1 sample a pixel: errors and spectra."""

from functools import partial

from figures._screen_space import sheet

make = partial(sheet, 1)
