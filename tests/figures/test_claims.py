"""Claims of the ledger: what figures find true or false, the papers' own sentences, and why some differ."""

import ast
import json
import os
import re
import subprocess
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest

from figures.catalogue import CATALOGUE, NO_DRAFT
from figures.ledger import PAPERS, Claim, claims, findings, left_out, reservation, stored, to_store
from figures.ledger._ledger import verdict
from figures.making import store
from figures.making.schema import UNDECIDED
from figures.page import _ledger as ledger_page
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
    claims_of = {key: held for key, held in found.get("claims", {}).items() if key not in timed}
    return {part: of for part, of in (found | {"claims": claims_of}).items() if of}


def test_verdicts():
    assert [verdict(found) for found in (True, False)] == ["reproduced", "differs"]
    cases = ({"a": True, "b": True}, {"a": False}, {"a": False, "b": True})
    assert [verdict(found) for found in cases] == ["reproduced", "differs", "depends"]
    open_ones = (UNDECIDED, {"a": UNDECIDED, "b": True}, {"a": False, "b": UNDECIDED})
    assert [verdict(found) for found in open_ones] == ["undecided"] * 3
    assert verdict({"a": True, "b": False, "c": UNDECIDED}) == "depends"


def test_titles_rest_on_what_this_run_found():
    """All stored findings agree with themselves; of others a title says how many are otherwise."""
    for name, entry in stored().items():
        assert reservation(name, "paper", entry["numbers"]) == ""
    kept = stored()["z-10"]["numbers"]["claims"]
    quality = kept["Z almost delivers the best quality"]
    numbers = {"claims": kept | {"Z almost delivers the best quality": dict.fromkeys(quality, UNDECIDED)}}
    total = sum(len(found) if isinstance(found, dict) else 1 for found in kept.values())
    said = f"3 of {total} differ"
    assert reservation("z-10", "draft", numbers) == f"draft: {said}"
    assert reservation("z-10", "paper", numbers) == f"not in this run: {said}"
    known = [of for found in kept.values() for of in (found.values() if isinstance(found, dict) else [found])]
    left = reservation("z-10", "draft", {"claims": left_out("z-10", ())})
    assert left == f"draft: {sum(of != UNDECIDED for of in known)} of {total} differ"


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
    """A figure with its key, a test, or neither and why; a few words of a sentence, or our question."""
    assert {claim.paper for claim in claims()} == PAPERS.keys()
    assert len({(claim.paper, claim.place, claim.claim) for claim in claims()}) == len(claims())
    for claim in claims():
        made = claim.figure is not None
        assert claim.place.strip() and claim.claim.strip(), claim
        assert made == (claim.key is not None) and not (made and claim.test), claim
        assert made or not (claim.timed or claim.measured), claim
        assert not claim.contrary or claim.test or (not made and claim.why), claim
        assert (claim.sentence is None) == (claim.question == "ours") == claim.claim.endswith("?"), claim
        if claim.sentence is not None:
            first, last = (part.split() for part in claim.sentence.split(" ... "))
            assert 1 <= len(first) <= 8 and 2 <= len(last) <= 6, claim


def test_figures_and_entries_have_the_same_claims():
    """Each claim of a figure has one entry, and each entry of a figure its claim."""
    entries = sorted((claim.figure, claim.key) for claim in MADE if not claim.timed)
    assert entries == sorted((name, key) for name, of in TABLE.items() for key in of.get("claims", ()))
    assert {claim.figure for claim in MADE} <= CATALOGUE.keys()


def test_what_differs_says_why():
    """In drafts, but for what is undecided by few keys, and in paper quality, whose numbers fill in texts."""
    rest = {"measured": Anything(), "printed": Anything()}
    drafts = {name: {"numbers": of | rest} for name, of in TABLE.items()}
    for entries, more in ((drafts, ("untested", "missing")), (stored(), ("undecided",))):
        wrong = "differs", "depends", *more
        for claim, result, measured, _, why in findings(entries):
            assert why or result not in wrong, (result, claim)
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


PAPERS_FOLDER = Path(os.environ.get("QMCJAX_PAPERS", ROOT.parent / "papers"))
FILES = {"hilbert": "000_56ec6905c4358b6c", "z": "001_205ef16bf284efc0", "thesis": "003_c36d6e129047407a"}
FAR = 600
"""Characters from the first word to the last: the longest sentences, and tables, have some 500."""


def letters(text):
    """Return letters and digits only: line breaks, hyphens, quotes, spaces and signs of markup differ."""
    return "".join(each for each in unicodedata.normalize("NFKC", text) if each.isalnum())


@pytest.mark.parametrize("paper", PAPERS)
def test_papers_have_the_sentences(paper):
    if not PAPERS_FOLDER.is_dir():
        pytest.skip(f"no texts of the papers in {PAPERS_FOLDER}: set QMCJAX_PAPERS")
    text = letters((PAPERS_FOLDER / f"{FILES[paper]}.txt").read_text(encoding="utf-8"))
    for claim in claims():
        if claim.paper == paper and claim.sentence is not None:
            first, last = map(letters, claim.sentence.split(" ... "))
            assert re.search(f"{first}.{{0,{FAR - len(first + last)}}}{last}", text), claim.sentence


OURS = (
    Claim("z", "Fig. 1", "Is it?", "f", "yes", question="ours"),
    Claim("z", "Fig. 1", "Is it so?", "f", "no", question="ours"),
    Claim("z", "Fig. 1", "Is it always?", "f", "cases", question="ours"),
    Claim("z", "Fig. 1", "Is it not?", test="tests/a.py::test_b", contrary=True, question="ours"),
    Claim("z", "Fig. 1", "Is it there?", "g", "yes", question="ours"),
    Claim("z", "Fig. 1", "It is", "f", "no", sentence="So it ... always is", criterion="at least 1 < 2"),
)
FOUND = {"f": {"numbers": {"claims": {"yes": True, "no": False, "cases": {"a": True, "b": False}}}}}


def test_our_own_questions_never_count_for_or_against_a_paper(monkeypatch):
    """And are apart on the page, which shows sentences."""
    monkeypatch.setattr("figures.ledger._ledger.claims", lambda: OURS)
    found = findings(FOUND)
    assert [each.verdict for each in found] == ["ours"] * 4 + ["missing", "differs"]
    answers = [each.cases for each in found[:4]]
    assert answers == [{"holds": True}, {"holds": False}, {"a": True, "b": False}, {"holds": False}]
    said, apart = ledger_page.section(found).split('<details id="questions">')
    assert "So it … always is" in said and "at least 1 &lt; 2" in said and "1 claims" in said
    assert "Is it" not in said and 'data-verdict="ours"' not in said
    assert apart.count('data-verdict="ours"') == 4 and "It is" not in apart
    assert "<h3" not in ledger_page.section(found[-1:])


def test_reasons_are_filled_in_as_measurements_are(monkeypatch):
    entry = {"f": {"numbers": {"claims": {"k": False}, "measured": {"a": 0.123}}}}
    why = "It has {measured[a]:.1f}."
    claim = Claim("z", "Fig. 1", "It is", "f", "k", why=why, sentence="So it ... is")
    monkeypatch.setattr("figures.ledger._ledger.claims", lambda: (claim, claim._replace(figure="g")))
    assert [found.why for found in findings(entry)] == ["It has 0.1.", ""]
