"""The page beside the figures, ``index.html``: claims and verdicts, all pictures, and images side by side."""

from figures.page._write import write as write
