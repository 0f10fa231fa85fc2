"""Reasons in the ledger hold no measurement: their numbers are filled in, but for those of the papers."""

import re
import string

import pytest

from figures.ledger import Claim, claims, findings

REFERENCE = r"(Eq\.|Fig\.|Sect\.|Table) \d[\d.]*\d?( and [\d.]+)?"
"""Where it stands in a paper."""

NAMED = (
    "(0,2)",
    "phi_2",
    "phi_3",
    "phi_5",
    "P_1 and P_3",
    "C_7 = 429",
    "C_6 = 132",
    "p + 1",
    "a_i = i",
    "x + y < 1",
    "[0, 1]",
    "m/2",
    "1 / (2 m)",
    "(4^log2(n) - 1) / 3",
    "the top-left quadrant is 2; 3 is the top-right one",
    "500^2 = 250 000",
    "125 000 = 50^3",
    "1600 belongs into the sine",
    "sqrt(6) / 4 and sqrt(90) / 32",
    "By the two printed areas it is 9.80 percent",
    "bases 2 and 3",
    "bases 5 and 7",
    "base 2",
    "32 bits",
    "intervals hold 1",
    "differ from 1",
)
"""Formulas and printed numbers of the papers, names, bases of sequences and sizes of integers."""

AMOUNT = r"\d|\b(a|one|two|three|some) (half|halves|thirds?|quarters?|fifths?|tenths?|percent)\b|\bhalf the\b"
"""A number, or a part of a whole in words."""

REASONS = {claim.why for claim in claims() if claim.why}


def typed(reason):
    """Return the first amount in a reason that is neither filled in nor a paper's; None if there is none."""
    text = "".join(part for part, *_ in string.Formatter().parse(reason))
    for phrase in sorted(NAMED, key=len, reverse=True):
        text = text.replace(phrase, "")
    found = re.search(AMOUNT, re.sub(REFERENCE, "", text))
    return None if found is None else found[0]


@pytest.mark.parametrize(
    ("reason", "amount"),
    [
        ("At 64 samples they do.", "6"),
        ("It has 4 % more.", "4"),
        ("The lattice is a third worse.", "a third"),
        ("By half the error.", "half the"),
        ("It has {measured[rms error][64 spp]:.2f} of it, see Eq. 4.3 and Table 4.1.", None),
        ("The (0,2)-sequence in base 2, by Fig. 12.", None),
    ],
)
def test_typed_amounts_are_seen(reason, amount):
    assert typed(reason) == amount


def test_no_reason_has_a_typed_measurement():
    assert {reason: found for reason in REASONS if (found := typed(reason))} == {}


@pytest.mark.parametrize("phrase", NAMED)
def test_each_phrase_that_is_allowed_is_used(phrase):
    assert any(phrase in reason for reason in REASONS)


def test_reasons_are_filled_in_as_measurements_are(monkeypatch):
    entry = {"f": {"numbers": {"claims": {"k": False}, "measured": {"a": 0.123}}}}
    why = "It has {measured[a]:.1f}."
    claim = Claim("z", "Fig. 1", "It is", "f", "k", why=why, sentence="So it ... is")
    monkeypatch.setattr("figures.ledger._ledger.claims", lambda: (claim, claim._replace(figure="g")))
    assert [found.why for found in findings(entry)] == ["It has 0.1.", ""]
