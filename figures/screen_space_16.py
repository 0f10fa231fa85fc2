"""All screen-space methods at 16 samples a pixel: errors and spectra."""

from functools import partial

from figures._screen_space import sheet

make = partial(sheet, 16)
