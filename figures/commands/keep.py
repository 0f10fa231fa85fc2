"""Keep what figures in paper quality have measured for the ledger: ``python -m figures keep FOLDER``."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from figures import ledger
from figures.making import store


def main(argv: Sequence[str] | None = None) -> int:
    """Write numbers beside the ledger, those of other figures stay; return the exit status, 0.

    Parameters
    ----------
    argv : sequence of str, optional
        A folder that ``python -m figures --quality paper --out FOLDER`` has written.
    """
    parser = argparse.ArgumentParser(
        prog="python -m figures keep",
        description="Keep the numbers of figures in paper quality beside the ledger: verdicts are theirs.",
    )
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args(argv).folder
    try:
        entries = ledger.stored() | ledger.to_store(store.read_numbers(folder))
    except (OSError, ValueError) as error:
        parser.error(f"{folder} must be a folder with figures, {error}")
    lines = [f"{json.dumps(name)}: {json.dumps(of, ensure_ascii=False)}" for name, of in entries.items()]
    store.write(ledger.FILE, ("{\n" + ",\n".join(lines) + "\n}\n").encode())
    print(f"{len(lines)} figures in {ledger.FILE}")
    return 0
