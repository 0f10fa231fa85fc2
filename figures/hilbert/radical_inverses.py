"""Radical inverses along space-filling curves, plain and scrambled (Hilbert paper, Fig. 3 and 4)."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import analysis
from figures.making.schema import Claims
from figures.shared import judged
from figures.shared.sheets.curve_tables import (
    CURVES,
    EXPLAINED,
    POWER,
    SHARE,
    Curve,
    enumerate_pixels,
    square,
    strongest_share,
    structure,
)
from figures.shared.sheets.image_sheets import Row, image_sheet
from qmcjax import sequences

SIDES = (64, 81)
BASES = (2, 3, 5)
SEEN = np.s_[: SIDES[0], : SIDES[0]]
"""What is drawn: pixels of all curves are of one size."""
SUPERIMPOSED = r"$(\phi_2, \phi_3, \phi_5)$"

PIXELS = f"{SIDES[0]} x {SIDES[0]} pixels, for Peano a part of {SIDES[1]} x {SIDES[1]}"

NOTE_3 = (
    f"{SIDES[0]} x {SIDES[0]} pixels, Peano {SIDES[1]} x {SIDES[1]}. {EXPLAINED} The powers of red, "
    "green and blue are added. The paper judges by eye."
)


def hilbert_3(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Show three radical inverses for each curve, and all of them as red, green and blue."""
    rows: dict[str, dict] = {rf"$\phi_{base}$": {} for base in BASES} | {SUPERIMPOSED: {}}
    measured = {}
    for name in CURVES:
        curve = square(name, *SIDES)
        images = {f"phi_{base}": enumerate_pixels(curve, sequences.van_der_corput(base)) for base in BASES}
        images["superimposed"] = np.stack(list(images.values()), axis=-1)
        for row, image in zip(rows.values(), images.values(), strict=True):
            row[name] = image[SEEN]
        measured[name] = {row: structure(image) for row, image in images.items()}
    title = (
        f"Radical inverses leave regular structures along all four curves\nHilbert paper, Fig. 3; {PIXELS}"
    )
    figure = image_sheet(title, {label: Row(images) for label, images in rows.items()})
    return figure, {"measured": measured, "claims": _claims_3(measured), "note": NOTE_3}


def _claims_3(measured: dict) -> Claims:
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


KEY = 1

PHI_2, PHI_5 = sequences.van_der_corput(2), 2
SOURCES = {
    "phi_2": (PHI_2, 0),
    "phi_2, digit scrambling": (sequences.digit_scramble(PHI_2, KEY), 0),
    "phi_2, Owen scrambling": (sequences.owen(PHI_2, KEY), 0),
    "phi_5": (sequences.halton(3), PHI_5),
    "phi_5, Faure-Lemieux": (sequences.halton(3, "faure_lemieux"), PHI_5),
    "phi_5, Faure": (sequences.halton(3, "faure"), PHI_5),
}
"""Sequences and their coordinates."""
SHOWN = ("phi_2", "phi_2, Owen scrambling", "phi_5", "phi_5, Faure-Lemieux")
"""Those that are drawn, of all that are measured."""
SCRAMBLED = ("phi_2, digit scrambling", "phi_2, Owen scrambling")

KEYS = 16
RANDOM: dict[str, tuple[int, Callable[[int], sequences.Sequence]]] = {
    "phi_2, digit scrambling": (2, lambda key: sequences.digit_scramble(PHI_2, key)),
    "phi_2, Owen scrambling": (2, lambda key: sequences.owen(PHI_2, key)),
    "phi_5, digit scrambling": (
        5,
        lambda key: sequences.components(sequences.halton(3, "random", key), (2,)),
    ),
    "phi_5, Owen scrambling": (5, lambda key: sequences.owen(sequences.van_der_corput(5), key)),
}
"""Bases, and scramblings by key."""
ATTENUATED = 0.95
"""Of the share, or less."""
ATTENUATES = "scrambling attenuates regular structures below the leading digit: the share by a twentieth"
BELOW = "share below the leading digit, scrambled over plain"

IN_COLUMNS = "leading bit is one in each column, and alternates from column to column"
ON_CURVE = "leading bit alternates along the curve"
ON_EDGES = "leading bit differs across every edge of two pixels"

NOTE_4 = (
    f"{SIDES[0]} x {SIDES[0]} pixels, Peano {SIDES[1]} x {SIDES[1]}. {EXPLAINED} The share of the power "
    "in the strongest 1 % of frequencies is written over each image. With digit scrambling, not drawn, "
    "phi_2 has the same parts as with Owen scrambling. We read 'improved according to Faure [9]' as the "
    "factors of Faure and Lemieux, in base 5 the digits 0 3 1 4 2. By this measure Morton, Hilbert and "
    "Moore stay as regular as they were, as the paper says. Peano is not helped most: it is the least "
    "regular curve, but slightly more regular with scrambling, and more so with Faure's own digits, "
    "0 3 2 1 4. Scrambling does lower the power at low frequencies, to half for all curves but Hilbert. "
    "The shares are blind to what scrambling attenuates: most power is that of the leading digit, whose "
    f"pattern no scrambling changes. Below it, with {KEYS} keys, Owen scrambling lowers the share of phi_5 "
    "to about half with all curves, and that of phi_2 to 0.82 with Hilbert and 0.87 with Moore."
)


def hilbert_4(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Show phi_2 by itself and scrambled in two ways, and phi_5 by itself and with better digits."""
    sheet: dict[str, dict[str, NDArray]] = {label: {} for label in SHOWN}
    measured = {}
    leading: dict[str, list[NDArray[np.bool_]]] = {}
    attenuated: dict[str, bool | str] = {}
    for name in CURVES:
        curve = square(name, *SIDES)
        images = {row: enumerate_pixels(curve, *source) for row, source in SOURCES.items()}
        for row in SHOWN:
            sheet[row][name] = images[row][SEEN]
        measured[name] = {row: structure(image) for row, image in images.items()}
        for row in SCRAMBLED:
            measured[name][row] |= _halves(curve, images[row])
            leading.setdefault(name, []).append(images[row] >= 0.5)
        ratios = {row: _below_leading(curve, *of) for row, of in RANDOM.items()}
        measured[name][BELOW] = {row: judged.ratio(of, 1) for row, of in ratios.items()}
        attenuated |= {f"{name}, {row}": judged.smaller(of, 1, ATTENUATED) for row, of in ratios.items()}
    rows = {
        row.replace("phi_2", r"$\phi_2$").replace("phi_5", r"$\phi_5$"): Row(
            images, captions={name: f"{100 * measured[name][row][SHARE]:.0f} %" for name in CURVES}
        )
        for row, images in sheet.items()
    }
    title = (
        "Scrambling leaves correlations along the curves: Morton's stripes stay\n"
        "Hilbert paper, Fig. 4\n"
        f"{PIXELS}\n"
        "above an image: what part of its power the strongest 1 % of frequencies have (white noise: 6 %)"
    )
    figure = image_sheet(title, rows)
    claims = {ATTENUATES: attenuated, **_claims_4(measured, leading)}
    return figure, {"measured": measured, "claims": claims, "note": NOTE_4}


def _below_leading(curve: Curve, base: int, scrambled: Callable[[int], sequences.Sequence]) -> list[float]:
    """Return by how much each of the keys lowers the share of the strongest frequencies.

    Only below the leading digit: scrambling permutes the values of that, which leaves its regularity.
    """
    found = []
    for sequence in (sequences.van_der_corput(base), *map(scrambled, range(KEYS))):
        # A little more, as a digit that is followed by zeros may be rounded down.
        rest = (base * enumerate_pixels(curve, sequence) + 1e-9) % 1
        found.append(strongest_share(analysis.error_spectrum(rest, np.zeros_like(rest))))
    return [share / found[0] for share in found[1:]]


def _halves(curve: Curve, image: NDArray[np.float64]) -> dict[str, bool]:
    """Tell how the leading bit goes along columns and along the curve."""
    upper = image >= 0.5
    x, y = curve.path()
    along = upper[y, x]
    return {
        IN_COLUMNS: bool(np.all(upper == upper[0]) and np.all(upper[0, 1:] != upper[0, :-1])),
        ON_CURVE: bool(np.all(along[1:] != along[:-1])),
        ON_EDGES: bool(np.all(upper[1:] != upper[:-1]) and np.all(upper[:, 1:] != upper[:, :-1])),
    }


def _claims_4(measured: dict, leading: dict[str, list[NDArray[np.bool_]]]) -> Claims:
    change = {
        name: rows["phi_5, Faure-Lemieux"][SHARE] - rows["phi_5"][SHARE] for name, rows in measured.items()
    }
    return {
        "scrambling phi_2 does not help with Morton: the stripes stay": all(
            measured["Morton"][row][IN_COLUMNS]
            and abs(measured["Morton"][row][SHARE] - measured["Morton"]["phi_2"][SHARE]) < 0.01
            for row in SCRAMBLED
        ),
        "however phi_2 is scrambled, pixels that follow each other on a curve are in different halves": all(
            measured[name][row][ON_CURVE] for name in CURVES for row in SCRAMBLED
        ),
        "for Hilbert, Moore and Peano so are all pixels that share an edge": all(
            measured[name][row][ON_EDGES] for name in ("Hilbert", "Moore", "Peano") for row in SCRAMBLED
        ),
        "the leading bit is the same by digit and by Owen scrambling, up to one flip for all": {
            name: bool(len(np.unique(np.not_equal(*pair))) == 1) for name, pair in leading.items()
        },
        "scrambling leaves correlations: more than twice the share of white noise": {
            f"{name}, {row}": rows[row][SHARE] > 0.1
            for name, rows in measured.items()
            for row in (*SCRAMBLED, "phi_5, Faure-Lemieux")
        },
        "the digits of phi_5 change little: the share by less than 0.02": {
            name: abs(change[name]) < 0.02 for name in ("Morton", "Hilbert", "Moore")
        },
        "they lower the share most for Peano": change["Peano"] == min(change.values()),
    }
