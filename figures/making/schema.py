"""The structure of the numbers of a figure."""

import math
from collections.abc import Mapping
from typing import Any

UNDECIDED = "undecided"

Found = bool | str
"""Whether a statement holds, or `UNDECIDED`."""

Claims = Mapping[str, Found | Mapping[str, Found]]
"""Which sentences of a paper hold, each one or case by case: true, false or undecided."""

PARTS = {
    "measured": "what was measured",
    "printed": "what the paper prints, and nothing else",
    "claims": "whether sentences of the paper hold, each one or case by case",
    "note": "how it was measured, and what else there is to say",
    "table": "rows, for a file of their own",
}


def check_numbers(numbers: dict[str, Any]) -> None:
    """Raise a ValueError that names the first invalid part of a figure's numbers."""
    _check_json(numbers, "numbers")
    for part in numbers:
        if part not in PARTS:
            raise ValueError(f"the parts of numbers must be among {', '.join(PARTS)}, got {part!r}")
    if _has_bools(numbers.get("printed")):
        raise ValueError("numbers['printed'] must have what the paper prints only, got true or false")
    claims = numbers.get("claims", {})
    if not isinstance(claims, dict):
        raise ValueError(f"numbers['claims'] must be a dict, got {claims!r}")
    for key, found in claims.items():
        cases = list(found.values()) if isinstance(found, dict) else [found]
        if not cases or not all(isinstance(case, bool) or case == UNDECIDED for case in cases):
            raise ValueError(
                f"numbers['claims'][{key!r}] must be a bool, {UNDECIDED!r}, or a dict of these, got {found!r}"
            )


def _has_bools(value: Any) -> bool:
    if isinstance(value, dict | list | tuple):
        return any(map(_has_bools, value.values() if isinstance(value, dict) else value))
    return isinstance(value, bool)


def _check_json(value: Any, key: str) -> None:
    """Raise a ValueError that names the key of the first part of ``value`` that is not JSON."""
    if isinstance(value, dict):
        for inner, item in value.items():
            if not isinstance(inner, str):
                raise ValueError(f"the keys of {key} must be strings, got {inner!r}")
            _check_json(item, f"{key}[{inner!r}]")
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            _check_json(item, f"{key}[{i}]")
    elif isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{key} must be finite, got {value!r}")
    elif value is not None and not isinstance(value, str | int):
        raise ValueError(f"{key} must be a plain Python value, got {value!r} of type {type(value).__name__}")
