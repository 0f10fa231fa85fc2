"""What figures find true or false: each finding is in a table, so that one that turns over fails here."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from figures import _store
from figures._catalogue import CATALOGUE

ROOT = Path(__file__).parents[1]
CLAIMS = json.loads(Path(__file__).with_name("claims.json").read_text(encoding="utf-8"))


def claims(value, path=()):
    """Return all that is true or false in a figure's numbers, by the keys that lead there."""
    if isinstance(value, bool):
        return {": ".join(path): value}
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return {key: claim for k, inner in items for key, claim in claims(inner, (*path, str(k))).items()}


def test_claims_are_seen_wherever_they_stand():
    numbers = {"measured": {"a": True, "b": [1, {"c": False}]}, "printed": "true", "count": 1}
    assert claims(numbers) == {"measured: a": True, "measured: b: 1: c": False}
    assert CLAIMS.keys() <= CATALOGUE.keys()


@pytest.mark.slow
def test_drafts_find_what_they_found(drafts):
    """Claims of drafts; also a new one, of any figure that is there, has to be in the table."""
    command = [sys.executable, "-m", "figures", *CLAIMS, "--out", str(drafts)]
    subprocess.run(command, cwd=ROOT, check=True)
    entries = {name: entry for name, entry in _store.read_numbers(drafts).items() if name in CATALOGUE}
    assert {entry["quality"] for entry in entries.values()} == {"draft"}
    found = {name: claims(entry["numbers"]) for name, entry in entries.items()}
    assert {name: those for name, those in found.items() if those} == CLAIMS
