"""The ledger quotes the papers: first and last words of each sentence are in the text, close together."""

import unicodedata
from pathlib import Path

import pytest

from figures.ledger import PAPERS, Claim, claims, findings
from figures.page import _ledger as ledger_page

PAPERS_FOLDER = Path(__file__).parents[3] / "shared" / "papers"
FILES = {
    "hilbert": "000_56ec6905c4358b6c.txt",
    "z": "001_205ef16bf284efc0.txt",
    "thesis": "003_c36d6e129047407a.txt",
}
FAR = 600
"""Characters from the first word to the last: the longest sentences, and tables, have some 500."""

QUOTED = [claim for claim in claims() if claim.sentence is not None]


def letters(text):
    """Return letters and digits only: line breaks, hyphens, quotes, spaces and signs of markup differ."""
    return "".join(each for each in unicodedata.normalize("NFKC", text) if each.isalnum())


def misquoted(text, sentence):
    """Return what is wrong with a quotation of a text that has letters only; None if nothing is."""
    first, _, last = map(letters, sentence.partition(" ... "))
    if not first or not last:
        return "not of the form 'first words ... last words'"
    starts = [start for start in range(len(text)) if text.startswith(first, start)]
    ends = [text.find(last, start + len(first)) + len(last) - start for start in starts]
    if not starts:
        return f"the paper does not have {sentence.partition(' ... ')[0]!r}"
    if not any(len(first) + len(last) <= end <= FAR for end in ends):
        return f"{sentence.partition(' ... ')[2]!r} does not follow"
    return None


def test_each_claim_quotes_a_sentence_or_is_our_own_question():
    for claim in claims():
        assert (claim.sentence is None) != (claim.question is None), claim
        assert claim.question in (None, "ours"), claim
        assert (claim.question is None) != claim.claim.endswith("?"), claim


def test_quotations_are_short():
    """Some words to find the sentence by, not the sentence."""
    for claim in QUOTED:
        first, mark, last = claim.sentence.partition(" ... ")
        assert mark and "..." not in last, claim
        assert 1 <= len(first.split()) <= 8 and 2 <= len(last.split()) <= 6, claim


def test_misquotations_are_seen():
    text = letters(
        "It con-\ntains  $x_1$ and, “surely”, a ﬁne Sobol’-net. " + "x" * FAR + " The end is near."
    )
    for sentence in ("It contains ... fine Sobol'-net", "contains x_1 ... surely"):
        assert misquoted(text, sentence) is None
    assert misquoted(text, "It contained ... Sobol'-net") == "the paper does not have 'It contained'"
    assert misquoted(text, "It contains").startswith("not of the form")
    for sentence in (
        "It contains ... Sobol sequence",
        "a fine ... contains x_1",
        "It contains ... end is near",
    ):
        assert "does not follow" in misquoted(text, sentence)


@pytest.mark.parametrize("paper", PAPERS)
def test_papers_have_the_sentences(paper):
    if not PAPERS_FOLDER.is_dir():
        pytest.skip("the papers' texts are not in this checkout's shared folder")
    text = letters((PAPERS_FOLDER / FILES[paper]).read_text(encoding="utf-8"))
    wrong = {
        claim.sentence: found
        for claim in QUOTED
        if claim.paper == paper
        for found in [misquoted(text, claim.sentence)]
        if found is not None
    }
    assert wrong == {}


OURS = (
    Claim("z", "Fig. 1", "Is it?", "f", "yes", question="ours"),
    Claim("z", "Fig. 1", "Is it so?", "f", "no", question="ours"),
    Claim("z", "Fig. 1", "Is it always?", "f", "cases", question="ours"),
    Claim("z", "Fig. 1", "Is it not?", test="tests/a.py::test_b", contrary=True, question="ours"),
    Claim("z", "Fig. 1", "Is it there?", "g", "yes", question="ours"),
    Claim("z", "Fig. 1", "It is", "f", "no", sentence="So it ... always is", criterion="at least 1 < 2"),
)
FOUND = {"f": {"numbers": {"claims": {"yes": True, "no": False, "cases": {"a": True, "b": False}}}}}


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setattr("figures.ledger._ledger.claims", lambda: OURS)
    return findings(FOUND)


def test_our_own_questions_never_count_for_or_against_a_paper(found):
    assert [each.verdict for each in found] == ["ours"] * 4 + ["missing", "differs"]
    answers = [each.cases for each in found[:4]]
    assert answers == [{"holds": True}, {"holds": False}, {"a": True, "b": False}, {"holds": False}]


def test_the_page_shows_sentences_and_our_own_questions_apart(found):
    text = ledger_page.section(found)
    said, apart = text.split('<h3 id="questions">')
    assert "So it … always is" in said and "at least 1 &lt; 2" in said and "1 claims" in said
    assert "Is it" not in said and 'data-verdict="ours"' not in said
    assert apart.count('data-verdict="ours"') == 4 and "It is" not in apart
    assert "<h3" not in ledger_page.section(found[-1:])
