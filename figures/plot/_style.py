"""One table of samplers: colour, marker and line of each, wherever it is drawn."""

from collections.abc import Iterable
from typing import NamedTuple

from figures._rc import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION

YELLOW = "#F0E442"
DARK = "#555555"
RED = "#8B0000"


class Style(NamedTuple):
    """How a sampler is drawn."""

    color: str
    marker: str
    line: str = "-"


SAMPLERS: dict[str, Style] = {
    # At random, or nearly.
    "random": Style(BLACK, "."),
    "jittered grid": Style(GREY, "x"),
    "Lloyd relaxation": Style(DARK, "p"),
    # One set in each pixel.
    "(0,2), Owen, new keys": Style(ORANGE, "X", "--"),
    "rank-1 lattice": Style(PURPLE, "s"),
    "(0,2), xor": Style(ORANGE, "^", ":"),
    "(0,2), Owen": Style(ORANGE, "o"),
    "SZ, Owen": Style(SKY, "*"),
    "R2, rotated": Style(PURPLE, "P", "--"),
    "pmj02": Style(ORANGE, "*"),
    "Sobol' net": Style(ORANGE, "D"),
    "modified Sobol' net": Style(GREEN, "d"),
    # One set over the screen.
    "Hammersley": Style(ORANGE, "s"),
    "Larcher-Pillichshammer": Style(GREEN, "v"),
    "optimised matrices": Style(SKY, "P"),
    "permutation": Style(VERMILLION, "^"),
    "Sobol' net, full screen": Style(ORANGE, ">", "--"),
    "modified Sobol' net, full screen": Style(GREEN, "<", "--"),
    "Sobol', full screen": Style(SKY, "8"),
    "Halton, full screen": Style(SKY, "v", "--"),
    # Optimised for what is left of errors after a filter.
    "dither mask": Style(YELLOW, "X"),
    "ranked keys": Style(PURPLE, "^"),
    "designed tiles": Style(RED, "*"),
    "progressive orders": Style(GREEN, "D"),
    "designed, progressive": Style(RED, "P"),
    "designed frames": Style(RED, "X"),
    "dither mask, golden shifts": Style(PURPLE, "D", "--"),
    # Along Morton's curve.
    "Z0": Style(BLUE, "1", ":"),
    "Z, hash": Style(BLUE, "o"),
    "Z, tree": Style(BLUE, "s", "--"),
    "Z, ART": Style(BLUE, "^", "-."),
    "Z, multiplicative": Style(BLUE, "D", ":"),
    "Z, new keys": Style(BLUE, "P"),
    "Z, moving": Style(BLUE, "X", "--"),
    "Z, joint": Style(BLUE, "*", "-."),
    "Z, 1 letter": Style(SKY, "$1$", ":"),
    "Z, 4 letters": Style(SKY, "$4$", ":"),
    "Z, 16 letters": Style(SKY, "$16$", ":"),
    "Z, 64 letters": Style(SKY, "$64$", ":"),
    "Z, 256 letters": Style(SKY, "$256$", ":"),
    # Along other curves, and from pixel to pixel in rows.
    "raster, Owen-Sobol'": Style(GREY, "s"),
    "Hilbert, Halton (2,3)": Style(VERMILLION, "o"),
    "Hilbert, Halton (3,5)": Style(VERMILLION, "s", "--"),
    "Hilbert, Owen-Sobol'": Style(VERMILLION, "D", "-."),
    "Hilbert, shifted lattice": Style(PURPLE, "v", "-."),
    "Hilbert, segments": Style(VERMILLION, "<", ":"),
    "Hilbert, partitioned": Style(VERMILLION, ">", ":"),
    "Moore, Halton (2,3)": Style(GREEN, "o"),
    "Peano, Halton (2,5)": Style(GREEN, "s", "--"),
    "Hilbert, Niederreiter-Xing": Style(VERMILLION, "P", "--"),
    "Hilbert, new keys": Style(VERMILLION, "X", "-."),
    "Hilbert, golden shifts": Style(VERMILLION, "*", ":"),
    "optimised orders": Style(GREEN, "*"),
    "optimised orders, new keys": Style(GREEN, "X", "--"),
    "optimised orders, moving": Style(GREEN, "P", "-."),
    # Mitsuba's.
    "Mitsuba, independent": Style(DARK, "o", "--"),
    "Mitsuba, stratified": Style(DARK, "s", "--"),
    "Mitsuba, multijitter": Style(DARK, "v", "--"),
    "Mitsuba, orthogonal": Style(DARK, "^", "--"),
    "Mitsuba, ldsampler": Style(DARK, "D", "--"),
}
"""In the order of legends. One colour may stand for a family, colour and marker together for one sampler."""

OWN = tuple(
    Style(f"#{color}", marker, line)
    for line, colors in {
        "-": "8A2BE2 A0522D 2F4F4F",
        "--": "8C564B E377C2 7F7F7F BCBD22 17BECF 1F3A93",
        ":": "F58231 2E8B57 9A6324 808000 911EB4 469990",
    }.items()
    for color, marker in zip(colors.split(), "*PXovD", strict=False)
)
"""Of samplers that are not in the table."""

_SAME = {
    "(0,2)-sequence": "(0,2), Owen",
    "(0,2)": "(0,2), Owen",
    "(0,2), Owen per pixel": "(0,2), Owen",
    "(0,2), xor per pixel": "(0,2), xor",
    "Heitz": "ranked keys",
    "Z": "Z, hash",
    "Sobol'": "Sobol', full screen",
    "global Sobol'": "Sobol', full screen",
    "global Halton": "Halton, full screen",
    "lattice, rotated": "rank-1 lattice",
    "dither, vectors": "dither mask",
    "Hilbert, segments (3,5)": "Hilbert, segments",
    "independent": "random",
    "Owen, each pixel": "(0,2), Owen",
    "global Sobol', xor": "Sobol', full screen",
    "raster, Owen": "raster, Owen-Sobol'",
    "Hilbert, Owen": "Hilbert, Owen-Sobol'",
    "Hilbert, Halton": "Hilbert, Halton (2,3)",
}
"""Names that figures have taken from the papers for what the table has."""


def style(name: str, among: Iterable[str] = ()) -> Style:
    """Return how a sampler is drawn.

    Parameters
    ----------
    name : str
    among : iterable of str
        All samplers of a plot: those that the table does not have get different styles.

    Returns
    -------
    Style

    Raises
    ------
    TypeError
        If ``name`` is not a string, or ``among`` is not made of strings.

    Examples
    --------
    >>> style("Z") == style("Z, hash"), style("mine") == style("his", ["mine", "his"])
    (True, False)
    """
    if not isinstance(name, str):
        raise TypeError(f"name must be the name of a sampler, got {name!r}")
    try:
        among = list(among)
        strange = [other for other in among if not isinstance(other, str)]
    except TypeError:
        strange = [among]
    if strange:
        raise TypeError(f"among must be names of samplers, got {strange!r}")
    known = _SAME.get(name, name)
    if known in SAMPLERS:
        return SAMPLERS[known]
    others = [other for other in dict.fromkeys((*among, name)) if _SAME.get(other, other) not in SAMPLERS]
    return OWN[others.index(name) % len(OWN)]
