"""Change the code on purpose, one place at a time: ``python tests/run_mutants.py [numbers]``.

A mutant of ``mutants.toml`` names a file, the text that it replaces there, and a test that fails then. They
run in a copy of the tracked files. The exit status is 1 if a mutant survives, or if a test fails by itself.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def mutants():
    """Return the mutants; each text to replace is in its file exactly once."""
    found = tomllib.loads(ROOT.joinpath("tests", "mutants.toml").read_text(encoding="utf-8"))["mutant"]
    for each in found:
        count = ROOT.joinpath(each["file"]).read_text(encoding="utf-8").count(each["old"])
        if count != 1:
            raise ValueError(f"{each['file']} must have {each['old']!r} once, got {count} times")
    return found


def passes(tree, *tests):
    """Return whether tests pass in a copy of the project."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-m", "", "-p", "no:randomly", *tests]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{' '.join(tests)} ended with status {done.returncode}:\n{done.stdout[-2000:]}")
    return done.returncode == 0


def main(numbers):
    """Run the mutants of some numbers, by default all."""
    chosen = {k: each for k, each in enumerate(mutants(), start=1) if not numbers or k in numbers}
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout
        for name in listed.decode().split("\0")[:-1]:
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)
        if not passes(tree, *{each["test"] for each in chosen.values()}):
            print("a test fails without a mutant")
            return 1
        alive = 0
        for k, each in chosen.items():
            path = tree / each["file"]
            kept = path.read_text(encoding="utf-8")
            path.write_text(kept.replace(each["old"], each["new"]), encoding="utf-8")
            survives = passes(tree, each["test"])
            path.write_text(kept, encoding="utf-8")
            alive += survives
            found = "SURVIVES" if survives else "killed"
            print(f"{k:3d} {found}: {each['file']}, {each['function']}", flush=True)
    print(f"{len(chosen) - alive} of {len(chosen)} mutants killed")
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main({int(word) for word in sys.argv[1:]}))
