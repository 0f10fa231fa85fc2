"""The header-only library OpenQMC, which is not shipped: where a user has a checkout of it.

https://github.com/AcademySoftwareFoundation/openqmc
"""

import os
from pathlib import Path

SWITCH = "QMCJAX_FIGURES_OPENQMC"
"""The variable by which processes that make figures know of the checkout."""

SAMPLERS = ("sobol", "sobolbn", "pmj", "pmjbn", "lattice", "latticebn")


def path() -> Path | None:
    """Return the checkout that the user has named, if any."""
    named = os.environ.get(SWITCH)
    return Path(named) if named else None


def headers(checkout: Path) -> list[Path]:
    """Return all files of the library, sorted; raise a ValueError if a sampler is missing."""
    folder = checkout / "include" / "oqmc"
    missing = [f"{name}.h" for name in SAMPLERS if not (folder / f"{name}.h").is_file()]
    if missing:
        raise ValueError(f"{str(checkout)!r} is no checkout of OpenQMC: include/oqmc has no {missing[0]}")
    return sorted(path for path in folder.rglob("*") if path.is_file())
