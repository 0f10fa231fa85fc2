"""Claims of the papers, one file a paper, and what figures found about them.

A figure computes whether a claim is true, false, or true in some cases, from what it measures, and keeps that
in the part ``claims`` of its numbers. Here is which sentence of which paper it is about. What no sentence of
a paper says is a question of our own, and its answer never counts for or against the paper.
"""

import json
import tomllib
from collections.abc import Collection, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from figures import catalogue

PAPERS = {name: f"{paper.authors}: {paper.title}" for name, paper in catalogue.PAPERS.items()}
"""The names of the files, and of the papers."""

FILE = Path(__file__).with_name("measured.json")
"""Numbers of figures in paper quality that are kept with the project: what the verdicts are computed from."""

SUITE = FILE.with_name("suite.json")
"""``scores.json`` of a comparison on all integrands and scenes, of 64 x 64 pixels."""

PARTS = ("measured", "printed", "claims")
"""What is kept of them."""


Found = bool | str
"""Whether a statement holds, or ``undecided``."""


class Claim(NamedTuple):
    """A sentence or a number of a paper that can be tested, or a question of our own about one."""

    paper: str
    place: str
    claim: str
    """In our words."""
    figure: str | None = None
    """The name of the figure that tests it, and its key in the claims of that."""
    key: str | None = None
    measured: str | None = None
    """What was measured, with fields of ``str.format`` that take it from the figure's numbers."""
    test: str | None = None
    """The test that shows it, by pytest's name, in place of a figure."""
    contrary: bool = False
    """Whether the test shows that it is false, or the paper's own numbers do, as ``why`` says."""
    timed: bool = False
    """Whether it is about run time, so that the machine decides."""
    why: str | None = None
    """Why it came out otherwise, or in some cases only; or why it is not tested; fields as above."""
    sentence: str | None = None
    """The first and the last words of the paper's own sentence, caption or row, with three dots between."""
    question: str | None = None
    """``ours``, in place of a sentence, if the paper does not say it."""
    criterion: str | None = None
    """In words, what the figure takes for reproduced."""


class Finding(NamedTuple):
    """What came out."""

    claim: Claim
    verdict: str
    """reproduced, differs, depends (on the case), undecided, by-test or untested; missing without its figure.
    Questions of our own that have an answer are all ours."""
    measured: str
    cases: Mapping[str, Found]
    """Which cases hold, of claims that have some, and of all questions of our own."""
    why: str
    """The claim's reason, with the numbers that were measured."""


@cache
def claims() -> tuple[Claim, ...]:
    """Return all claims, in the order of papers and places."""
    found = []
    for paper in PAPERS:
        text = (resources.files("figures.ledger") / f"{paper}.toml").read_text(encoding="utf-8")
        found += [Claim(paper, **entry) for entry in tomllib.loads(text).get("claim", [])]
    return tuple(found)


@cache
def stored() -> dict[str, dict[str, Any]]:
    """Return entries by the figures' names, as those of ``numbers.json``; none if nothing is kept."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}


def to_store(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return what is stored of entries of ``numbers.json``: those of claims, in paper quality."""
    of_claims = {claim.figure for claim in claims()}
    return {
        name: {key: entry[key] for key in ("quality", "date", "machine", "seconds")}
        | {"numbers": {part: entry["numbers"][part] for part in PARTS if part in entry["numbers"]}}
        for name, entry in sorted(entries.items())
        if name in of_claims and entry["quality"] == "paper"
    }


def findings(entries: Mapping[str, Mapping[str, Any]], figure: str | None = None) -> list[Finding]:
    """Return what came out of each claim, or of those about one figure.

    Parameters
    ----------
    entries : mapping
        Those of ``numbers.json``, by the figures' names.
    figure : str, optional
    """
    return [_finding(claim, entries) for claim in claims() if figure in (None, claim.figure)]


def left_out(figure: str, found: Collection[str]) -> dict[str, Found]:
    """Return the claims of a figure that are not among those found, as undecided."""
    keys = (claim.key for claim in claims() if claim.figure == figure and claim.key is not None)
    return {key: "undecided" for key in keys if key not in found}


def _finding(claim: Claim, entries: Mapping[str, Mapping[str, Any]]) -> Finding:
    why = claim.why or ""
    if claim.test is not None:
        if claim.question is not None:
            return Finding(claim, "ours", claim.measured or "", _answer(not claim.contrary), why)
        return Finding(claim, "differs" if claim.contrary else "by-test", claim.measured or "", {}, why)
    if claim.figure is None or claim.key is None:
        return Finding(claim, "differs" if claim.contrary else "untested", "", {}, why)
    numbers = entries.get(claim.figure, {}).get("numbers", {})
    found = numbers.get("claims", {}).get(claim.key)
    plain = "" if "{" in why else why  # A reason with numbers is none without them.
    if found is None:
        return Finding(claim, "missing", "", {}, plain)
    result = verdict(found)
    try:
        measured, why = (text.format_map(_readable(numbers)) for text in (claim.measured or "", why))
    except LookupError:  # Drafts do not measure all of what they leave undecided.
        if result != "undecided":
            raise
        measured, why = "", plain
    if claim.question is not None:
        return Finding(claim, "ours", measured, _answer(found), why)
    cases = {} if isinstance(found, bool | str) else found
    return Finding(claim, result, measured, cases, why)


def _answer(found: Found | Mapping[str, Found]) -> Mapping[str, Found]:
    return {"holds": found} if isinstance(found, bool | str) else found


class _Dict(dict[str, Any]):
    """A dict as a text has it; ``str.format`` asks it for keys like 13 as integers.

    Its ``last`` entry is that of the largest size, which is smaller in drafts.
    """

    def __missing__(self, key: str | int) -> Any:
        if isinstance(key, int):
            return self[str(key)]
        if key == "last":
            return list(self.values())[-1]
        raise KeyError(key)

    def __format__(self, spec: str) -> str:
        return "; ".join(f"{key}: {format(value, spec)}" for key, value in self.items())


class _List(list[Any]):
    """A list as a text has it."""

    def __format__(self, spec: str) -> str:
        return ", ".join(format(value, spec) for value in self)


def _readable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _Dict({key: _readable(inner) for key, inner in value.items()})
    return _List(map(_readable, value)) if isinstance(value, list) else value


def verdict(found: Found | Mapping[str, Found]) -> str:
    """Return the verdict about a claim that holds, does not or is undecided, or does so case by case."""
    held = set([found] if isinstance(found, bool | str) else found.values())
    if held == {True}:
        return "reproduced"
    if held == {False}:
        return "differs"
    return "depends" if held >= {True, False} else "undecided"


def reservation(name: str, quality: Any, numbers: Any) -> str:
    """Return how many findings of a run are not those that a figure's title rests on, empty if all are.

    Titles state what the stored run in paper quality found. Others, drafts above all, may leave it undecided.
    """
    kept = stored().get(name, {}).get("numbers", {}).get("claims", {})
    found = numbers.get("claims") if isinstance(numbers, Mapping) else None
    if not isinstance(found, Mapping):
        return ""
    pairs = [(of, _case(found.get(key), case)) for key in kept for case, of in _cases(kept[key]).items()]
    count = sum(one != other and other is not None for one, other in pairs)
    run = "draft" if quality == "draft" else "not in this run"
    return f"{run}: {count} of {len(pairs)} differ" if count else ""


def _cases(found: Any) -> Mapping[str, Found]:
    return found if isinstance(found, Mapping) else {"": found}


def _case(found: Any, case: str) -> Any:
    """Return what is found of a case: all cases of what a draft leaves out are undecided."""
    return found.get(case) if isinstance(found, Mapping) else found
