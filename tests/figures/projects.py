"""A folder with a package of small figures, and the command line on it, run as its user would."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from figures import page

ROOT = Path(__file__).parents[2]

COMMAND = """
import json, signal, sys
from figures.__main__ import main
from figures.catalogue import Entry
signal.signal(signal.SIGINT, signal.default_int_handler)
names = json.load(open("catalogue.json"))
status = main(sys.argv[1:], {name: Entry(f"fakes.{name}", f"Title of {name}") for name in names})
print("imported:", {"jax", "numpy", "scipy", "matplotlib"} & set(sys.modules))
sys.exit(status)
"""

GOOD = """
import os
from pathlib import Path
from matplotlib.figure import Figure
from fakes._shared import VALUE

def make(quality, progress):
    with Path("calls").open("a") as calls:
        print(__name__.removeprefix("fakes."), file=calls)
    progress(0.5)
    process = [os.getpid(), os.environ["GLIBC_TUNABLES"], os.environ["MPLBACKEND"]]
    measured = {"value": VALUE, "process": process}
    numbers = {"measured": measured, "printed": [1, 2.5, None], "note": quality}
    return Figure(figsize=(3.3, 1)), numbers
"""

SLEEPING = """
import os, time
from pathlib import Path
from fakes import one

def make(quality, progress):
    if Path("slow").exists():
        Path("started.part").write_text(str(os.getpid()))
        os.replace("started.part", "started")
        time.sleep(60)
    return one.make(quality, progress)
"""


class Project:
    def __init__(self, folder, **modules):
        self.folder = folder
        self.out = folder / "out"
        self.write("__init__", "")
        self.write("_shared", "VALUE = 1")
        for name, text in modules.items():
            self.write(name, text)
        (folder / "catalogue.json").write_text(json.dumps(list(modules)))

    def write(self, module, text):
        path = self.folder / "fakes" / f"{module}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)

    def start(self, *arguments, stderr=subprocess.PIPE, **environment):
        # One after the other, unless a test is about that; and nothing is left in the user's folders.
        more = () if "--jobs" in arguments else ("--jobs", "1")
        more += () if "XDG_CACHE_HOME" in environment else ("--no-cache",)
        environment = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
        command = [sys.executable, "-c", COMMAND, *arguments, *more]
        how = {"cwd": self.folder, "env": environment, "text": True, "start_new_session": True}
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, **how)

    def run(self, *arguments, **environment):
        process = self.start(*arguments, **environment)
        stdout, stderr = process.communicate(timeout=60)
        return process.returncode, stdout, stderr

    def started(self, *arguments):
        """Start with a figure that sleeps, and return the process and that of its worker."""
        (self.folder / "slow").touch()
        process = self.start(*arguments)
        wait_for((self.folder / "started").exists)
        return process, (self.folder / "started").read_text()

    def numbers(self):
        return json.loads((self.out / "numbers.json").read_text())

    def calls(self):
        """Return which figures were made since the last time this was asked."""
        path = self.folder / "calls"
        names = path.read_text().split() if path.exists() else []
        path.unlink(missing_ok=True)
        return names

    def files(self):
        """Return what is in the output folder, but for the pages to which the first one leads."""
        return sorted(path.name for path in self.out.iterdir() if path.name not in page.FILES[1:])


def of_figures(*names):
    """Return what is in an output folder with figures."""
    pictures = (f"{name}.{end}" for name in names for end in ("png", "webp"))
    return sorted(["index.html", "numbers.json", *pictures])


def wait_for(condition, seconds=30.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def alive(pid):
    """Whether a process runs; one that ended and was not yet waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
