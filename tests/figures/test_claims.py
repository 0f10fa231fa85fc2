"""What figures find true or false: each finding is in a table, so that one that turns over fails here."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from figures.catalogue import CATALOGUE, NO_DRAFT
from figures.ledger import PAPERS, claims, findings, stored, to_store
from figures.ledger._ledger import verdict
from figures.making import store
from figures.making.schema import UNDECIDED
from figures.shared import judged

ROOT = Path(__file__).parents[2]
TABLE = json.loads((Path(__file__).parents[1] / "claims.json").read_text(encoding="utf-8"))
TESTED = [claim for claim in claims() if claim.test is not None]
MADE = [claim for claim in claims() if claim.figure is not None]


def booleans(value):
    """Return all that is true, false or undecided in a figure's numbers; None if nothing is."""
    if isinstance(value, bool) or value == UNDECIDED:
        return value
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    found = {str(key): booleans(inner) for key, inner in items}
    return {key: inner for key, inner in found.items() if inner is not None} or None


def without_times(figure, found):
    """Leave out claims about run time, of which the machine decides."""
    timed = {claim.key for claim in MADE if claim.timed and claim.figure == figure}
    return {
        part: kept
        for part, of in found.items()
        if (kept := {key: held for key, held in of.items() if part != "claims" or key not in timed})
    }


def test_booleans_are_seen_wherever_they_stand():
    numbers = {"measured": {"a": True, "b": [1, {"c": False}], "d": {"e": 1}}, "printed": "true", "count": 1}
    assert booleans(numbers) == {"measured": {"a": True, "b": {"1": {"c": False}}}}
    assert booleans({"claims": {"a": UNDECIDED}}) == {"claims": {"a": UNDECIDED}}
    assert TABLE.keys() <= CATALOGUE.keys() - NO_DRAFT.keys()


def test_verdicts():
    assert [verdict(found) for found in (True, False)] == ["reproduced", "differs"]
    cases = ({"a": True, "b": True}, {"a": False}, {"a": False, "b": True})
    assert [verdict(found) for found in cases] == ["reproduced", "differs", "depends"]
    open_ones = (UNDECIDED, {"a": UNDECIDED, "b": True}, {"a": False, "b": UNDECIDED})
    assert [verdict(found) for found in open_ones] == ["undecided"] * 3
    assert verdict({"a": True, "b": False, "c": UNDECIDED}) == "depends"


def test_judgements_are_by_intervals():
    """Of means of 16 values: true, false, or neither where the interval contains the limit."""
    values = 1 + 0.1 * np.random.default_rng(1).normal(size=16)
    assert [judged.below(values, limit) for limit in (1.2, 0.8, 1.0)] == [True, False, UNDECIDED]
    assert judged.below([1, 1, 1], 2) == UNDECIDED, "three values are too few"
    errors = np.exp(np.random.default_rng(2).normal(size=16))
    assert judged.smaller(errors, 1.1 * errors) is True
    assert judged.smaller(errors, 1.1 * errors, 0.8) is False
    assert judged.smaller(errors, errors[::-1]) == UNDECIDED


def test_what_is_stored_is_what_verdicts_need():
    entry = {"quality": "paper", "date": "d", "machine": "m", "seconds": 1.0, "title": "t"}
    numbers = {"claims": {"k": True}, "note": "n", "measured": {"a": 1}}
    name = MADE[0].figure
    found = to_store({name: entry | {"numbers": numbers}, "other": entry | {"numbers": numbers}})
    assert found.keys() == {name}
    assert found[name]["numbers"] == {"claims": {"k": True}, "measured": {"a": 1}}
    assert "title" not in found[name]
    assert not to_store({name: entry | {"numbers": numbers, "quality": "draft"}})


def test_entries_are_whole_and_unique():
    """A figure with its key, a test, or neither and why."""
    assert {claim.paper for claim in claims()} == PAPERS.keys()
    assert len({(claim.paper, claim.place, claim.claim) for claim in claims()}) == len(claims())
    for claim in claims():
        assert claim.place.strip() and claim.claim.strip(), claim
        assert (claim.figure is None) == (claim.key is None), claim
        assert claim.figure is None or claim.test is None, claim
        assert not claim.contrary or claim.test is not None, claim
        assert claim.measured is None or claim.figure is not None, claim
        assert not claim.timed or claim.figure is not None, claim


def test_figures_and_entries_have_the_same_claims():
    """Each claim of a figure has one entry, and each entry of a figure its claim."""
    entries = sorted((claim.figure, claim.key) for claim in MADE if not claim.timed)
    assert entries == sorted((name, key) for name, of in TABLE.items() for key in of.get("claims", ()))
    assert {claim.figure for claim in MADE} <= CATALOGUE.keys()


def test_what_differs_says_why():
    """Not what is undecided: drafts have few keys, and say that they are too small."""
    rest = {"measured": Anything(), "printed": Anything()}
    found = findings({name: {"numbers": of | rest} for name, of in TABLE.items()})
    for claim, result, *_ in found:
        if result in ("differs", "depends", "untested", "missing"):
            assert claim.why, (result, claim)


def test_what_is_stored_differs_for_a_reason():
    """Verdicts of paper quality, too; their numbers fill in what was measured."""
    for claim, result, measured, _, why in findings(stored()):
        if result in ("differs", "depends", "undecided"):
            assert why, (result, claim)
        assert not re.search(r"[{}]|None", measured + why), claim


class Anything:
    """Numbers that are not there."""

    def __getitem__(self, key):
        return self

    def __format__(self, spec):
        return "0"


@pytest.mark.parametrize("test", sorted({claim.test for claim in TESTED}))
def test_tests_of_entries_exist(test):
    path, _, name = test.partition("::")
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.slow
def test_drafts_find_what_they_found(drafts):
    """Claims of drafts; also a new one, of any figure that is there, has to be in the table."""
    made = sorted((TABLE.keys() | {claim.figure for claim in MADE}) - NO_DRAFT.keys())
    subprocess.run([sys.executable, "-m", "figures", *made, "--out", str(drafts)], cwd=ROOT, check=True)
    entries = {name: entry for name, entry in store.read_numbers(drafts).items() if name in CATALOGUE}
    assert {entry["quality"] for entry in entries.values()} == {"draft"}
    found = {name: without_times(name, booleans(entry["numbers"]) or {}) for name, entry in entries.items()}
    assert {name: those for name, those in found.items() if those} == TABLE
    for finding in findings(entries):
        assert (finding.verdict == "missing") == (finding.claim.figure in NO_DRAFT)
        assert not re.search(r"[{}]|None", finding.measured), finding
