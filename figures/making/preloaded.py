"""What most figures import: once, in the process that their workers are forked from.

To import JAX, SciPy and matplotlib takes longer than many drafts. No backend of JAX may start here: its
threads do not survive a fork.
"""

import gc
import importlib
import os
from contextlib import suppress

MODULES = (
    "matplotlib.backends.backend_agg",
    "matplotlib.pyplot",
    "PIL.PngImagePlugin",
    "PIL.WebPImagePlugin",
    "figures.shared.sheets.image_sheets",
    "figures.shared.rendered.pixel_sets",
)

os.environ["MPLBACKEND"] = "Agg"  # matplotlib reads it when it is imported.
for name in MODULES:
    with suppress(Exception):  # A figure that needs what is broken says so.
        importlib.import_module(name)
gc.freeze()  # Collections of workers would otherwise write to, and so copy, all of it.
