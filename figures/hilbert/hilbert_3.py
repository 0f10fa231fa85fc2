"""Hilbert paper Fig. 3: radical inverses along space-filling curves, as images."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from figures.making.schema import Claims
from figures.shared.sheets.curve_tables import CURVES, EXPLAINED, POWER, SHARE, enumerated, square, structure
from figures.shared.sheets.image_sheets import Row, image_sheet
from qmcjax import sequences

SIDES = (64, 81)
BASES = (2, 3, 5)
SUPERIMPOSED = r"$(\phi_2, \phi_3, \phi_5)$"

NOTE = (
    f"{SIDES[0]} x {SIDES[0]} pixels, Peano {SIDES[1]} x {SIDES[1]}. {EXPLAINED} The powers of red, green "
    "and blue are added up. The paper judges by eye: superimposed, correlations with the Moore "
    "and Hilbert curves become harder to identify."
)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Show three radical inverses for each curve, and all of them as red, green and blue."""
    rows: dict[str, dict] = {rf"$\phi_{base}$": {} for base in BASES} | {SUPERIMPOSED: {}}
    measured = {}
    for name in CURVES:
        curve = square(name, *SIDES)
        images = {f"phi_{base}": enumerated(curve, sequences.van_der_corput(base)) for base in BASES}
        images["superimposed"] = np.stack(list(images.values()), axis=-1)
        for row, image in zip(rows.values(), images.values(), strict=True):
            row[name] = image
        measured[name] = {row: structure(image) for row, image in images.items()}
    title = "Radical inverses along the curves (Hilbert paper, Fig. 3)"
    figure = image_sheet(title, {label: Row(images) for label, images in rows.items()})
    return figure, {"measured": measured, "claims": _claims(measured), "note": NOTE}


def _claims(measured: dict) -> Claims:
    share = {name: {row: of[SHARE] for row, of in rows.items()} for name, rows in measured.items()}
    together = {name: rows["superimposed"] for name, rows in share.items()}
    return {
        "all have regular structures: more than twice the share of white noise": {
            name: min(rows.values()) > 0.1 for name, rows in share.items()
        },
        "they resemble masks of blue noise: less than half of white noise at low frequencies": {
            f"{name}, {row}": of[POWER] < 0.5 for name, rows in measured.items() for row, of in rows.items()
        },
        "Morton, phi_2: nothing but stripes and other structures": share["Morton"]["phi_2"] > 0.99,
        "superimposed, Hilbert and Moore are less regular than each of the three": {
            f"{name}, {row}": together[name] < share[name][row]
            for name in ("Hilbert", "Moore")
            for row in ("phi_2", "phi_3", "phi_5")
        },
        "superimposed, Hilbert and Moore are less regular than Morton and Peano": (
            max(together["Hilbert"], together["Moore"]) < min(together["Morton"], together["Peano"])
        ),
    }
