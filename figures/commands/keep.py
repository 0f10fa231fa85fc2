"""Keep what figures in paper quality have measured for the ledger: ``qmcjax keep FOLDER``."""

import json
from collections.abc import Sequence
from pathlib import Path

from figures import ledger
from figures._options import command
from figures.making import store


def main(argv: Sequence[str] | None = None) -> int:
    """Write the numbers of a folder that ``qmcjax --quality paper --out FOLDER`` has made.

    They go beside the ledger; those of other figures stay.
    """
    parser = command(
        "keep", "Keep the numbers of figures in paper quality beside the ledger: verdicts are theirs."
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
