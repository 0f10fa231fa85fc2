"""All screen-space methods: radial spectra of their errors, from 1 to 64 samples a pixel."""

from collections.abc import Callable

from matplotlib.figure import Figure

from figures.shared import screen_space_sheets
from figures.shared.screen_space import FAMILIES, NOTE, SIDE, measure, methods, radial_power

COUNTS = (1, 4, 16, 64)


def make(quality: str, progress: Callable[[float], None]) -> tuple[Figure, dict]:
    """Measure the spectra, and draw them by families of methods."""
    side, powers, low = SIDE[quality], {}, {}
    for done, spp in enumerate(COUNTS, start=1):
        powers[spp] = {}
        for name, method in methods().items():
            errors, measured = measure(method, side, spp)
            powers[spp][name] = radial_power(errors)
            low.setdefault(name, {})[f"{spp} spp"] = {
                integrand: of["low-frequency power"] for integrand, of in measured.items()
            }
        progress(done / len(COUNTS))
    figure = screen_space_sheets.spectra(powers, FAMILIES)
    table = [
        {"sampler": name, "spp": spp, "cycles per pixel": float(cycles), "power": float(value)}
        for spp, of in powers.items()
        for name, curve in of.items()
        for cycles, value in zip(*curve, strict=True)
    ]
    note = NOTE.format(side=side, spp=", ".join(map(str, COUNTS)))
    return figure, {"measured": {"low-frequency power": low}, "table": table, "note": note}
