"""Small inventories of other projects' names, for links in builds without a network."""

import zlib
from pathlib import Path

_PROJECTS = {
    "numpy": (
        "https://numpy.org/doc/stable/",
        {
            "numpy.ndarray": ("class", "reference/generated/numpy.ndarray.html"),
            "numpy.typing.ArrayLike": ("data", "reference/typing.html#$"),
        },
    ),
    "scipy": (
        "https://docs.scipy.org/doc/scipy/",
        {"scipy.stats.qmc.QMCEngine": ("class", "reference/generated/scipy.stats.qmc.QMCEngine.html")},
    ),
    "jax": (
        "https://docs.jax.dev/en/latest/",
        {"jax.Array": ("class", "_autosummary/jax.Array.html")},
    ),
    "matplotlib": (
        "https://matplotlib.org/stable/",
        {
            "matplotlib.axes.Axes": ("class", "api/_as_gen/matplotlib.axes.Axes.html"),
            "matplotlib.figure.Figure": ("class", "api/_as_gen/matplotlib.figure.Figure.html"),
        },
    ),
}


def mapping(folder: Path) -> dict[str, tuple[str, tuple[str | None, str]]]:
    """Write the inventories, and return what intersphinx takes: each project's own, then ours."""
    folder.mkdir(parents=True, exist_ok=True)
    found = {}
    for project, (address, names) in _PROJECTS.items():
        head = f"# Sphinx inventory version 2\n# Project: {project}\n# Version: \n# Compressed by zlib:\n"
        lines = "".join(f"{name} py:{kind} 1 {page} -\n" for name, (kind, page) in names.items())
        path = folder / f"{project}.inv"
        path.write_bytes(head.encode() + zlib.compress(lines.encode()))
        found[project] = (address, (None, str(path)))
    return found
