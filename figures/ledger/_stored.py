"""Numbers of figures in paper quality that are kept with the project: what the verdicts are computed from."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from figures.ledger._ledger import claims

FILE = Path(__file__).with_name("measured.json")
PARTS = ("measured", "printed", "claims")


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
