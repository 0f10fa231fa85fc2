"""The command line on several machines, here processes of one: they share the work, or end together."""

import os
import re
import shlex
import signal
import time

import numpy as np
import pytest
from projects import COMMAND, GOOD, ROOT, SLEEPING, Project, alive, of_figures, wait_for
from tables import free_port

from figures.making import store
from figures.making.job import Where, explain

MEETING = """
    end = time.monotonic() + 20
    while {missing}:
        if time.monotonic() > end:
            raise RuntimeError("alone")
        time.sleep(0.02)
"""
PAIR = GOOD.replace(
    "    progress(0.5)",
    "    import time\n    Path(__name__).touch()"
    + MEETING.format(missing='not (Path("fakes.a").exists() and Path("fakes.b").exists())'),
)
"""Each of two figures waits for the other to begin."""

SHARING = f"""
import os, time
from functools import partial
from pathlib import Path
from matplotlib.figure import Figure
from figures.making import finished_cells

def compute(name):
    with Path("cells").open("a") as file:
        print(name, os.getpid(), file=file)
    if Path("broken").exists() and name == "b":
        raise RuntimeError("the sky fell")
{MEETING.format(missing='len(set(Path("cells").read_text().split()[1::2])) < 2')}
    return [ord(name), 0.1]

def make(quality, progress):
    found = finished_cells.shared("first", {{name: partial(compute, name) for name in "abcd"}}, progress)
    again = finished_cells.shared("then", {{name: partial(compute, name) for name in "ef"}})
    return Figure(figsize=(1, 1)), {{"measured": {{n: cell.tolist() for n, cell in (found | again).items()}}}}
"""
"""A figure of which processes share the cells."""

BROKEN = "def make(quality, progress):\n    raise RuntimeError('the sky fell')"
ADVICE = "what was finished stays in out, and the same command goes on with the rest\n"


class Hasty(Project):
    """With short times to wait."""

    command = COMMAND.replace(
        "status =",
        "from figures.making import job\njob.WAIT, job.HEARTBEAT, job.VISIBLE = 3, 4, 1\nstatus =",
    )

    def join(self, port, process, processes=2, *arguments):
        coordinator = ("--coordinator", f"127.0.0.1:{port}", "--processes", str(processes))
        return self.start(*coordinator, "--process-id", str(process), *arguments)

    def by_hand(self):
        """Run what the documentation says for two hosts."""
        port = free_port()
        hosts = [of_page("alpha$"), of_page("beta$")]
        return results(
            self.start(*(each.replace("alpha:9876", f"127.0.0.1:{port}") for each in host)) for host in hosts
        )

    def under_slurm(self):
        """Run what the documentation says, as srun does it for two tasks."""
        cluster = {"SLURM_JOB_ID": str(os.getpid()), "SLURM_STEP_NODELIST": "localhost", "SLURM_NTASKS": "2"}
        return [
            self.start(*of_page("srun"), **cluster, SLURM_PROCID=str(process), SLURM_LOCALID="0")
            for process in (0, 1)
        ]


def of_page(first):
    """Return the arguments of the command in the documentation that begins so, for this machine."""
    page = (ROOT / "figures" / "docs" / "long_runs.rst").read_text(encoding="utf-8")
    (found,) = re.findall(rf"^   {re.escape(first)} qmcjax (.*)$", page, re.MULTILINE)
    return shlex.split(found.replace("/shared/", ""))


def results(processes):
    """Return what processes printed, their errors and exit statuses."""
    return [(*process.communicate(timeout=60), process.returncode) for process in list(processes)]


@pytest.mark.slow
def test_processes_share_the_figures(tmp_path):
    """Each makes some, process 0 shows all; what failed elsewhere is told, and nothing is made twice."""
    project = Hasty(tmp_path, a=PAIR, b=PAIR, c=GOOD, d=BROKEN)
    (first, said, status), (second, also, other) = project.by_hand()
    made = [re.findall(r"^(\w): \d", text, re.MULTILINE) for text in (first, second)]
    assert sorted(made[0] + made[1]) == ["a", "b", "c"]
    assert ("a" in made[0]) != ("b" in made[0])
    assert status == 1 and said.endswith("1 of 4 figures failed: d\n")
    assert (said + also).count("the sky fell") == 2 and other == ("the sky fell" in also)
    assert "out/index.html" in first and "index.html" not in second
    assert "imported: set()" in first and "imported: set()" in second
    assert list(project.numbers()) == ["a", "b", "c"]
    assert project.files() == of_figures("a", "b", "c")


@pytest.mark.slow
def test_processes_share_the_cells_of_a_figure(tmp_path):
    project = Hasty(tmp_path, one=SHARING)
    first, second = project.by_hand()
    assert [first[1:], second[1:]] == [("", 0)] * 2
    assert (first[0] + second[0]).count("one: ") == 1
    cells, processes = np.array((tmp_path / "cells").read_text().split()).reshape(-1, 2).T
    assert sorted(cells) == list("abcdef") and len(set(processes)) == 2
    assert project.numbers()["one"]["numbers"]["measured"] == {n: [ord(n), 0.1] for n in "abcdef"}
    assert project.files() == of_figures("one")


@pytest.mark.slow
def test_a_cell_that_fails_in_any_process_fails_its_figure(tmp_path):
    """At once, and others are finished; what is computed stays."""
    project = Hasty(tmp_path, one=SHARING, two=GOOD)
    (tmp_path / "broken").touch()
    ended = project.by_hand()
    assert ended[0][2] == 1 and ended[0][1].endswith("1 of 2 figures failed: one\n")
    assert sum("RuntimeError: the sky fell" in said for _, said, _ in ended) == 1
    assert list(project.numbers()) == ["two"]
    (tmp_path / "broken").unlink()
    taken = (tmp_path / "cells").read_text().split()[::2]
    assert project.run()[::2] == (0, "")
    assert sorted((tmp_path / "cells").read_text().split()[::2]) == sorted([*taken, "b", "e", "f"])
    assert not (project.out / ".cells").exists()


@pytest.mark.slow
def test_a_lost_process_ends_the_job_and_is_named(tmp_path):
    """What is finished stays, and the same command goes on with the rest."""
    project = Hasty(tmp_path, one=GOOD, two=SLEEPING)
    (tmp_path / "slow").touch()
    processes = project.under_slurm()
    wait_for((tmp_path / "started").exists)
    wait_for(lambda: any("one" in path.read_text() for path in project.out.glob("numbers-of-process-?.json")))
    os.killpg(processes[1].pid, signal.SIGKILL)
    begin = time.monotonic()
    (_, stderr, status), _ = results(processes)
    assert time.monotonic() - begin < 20
    assert (status, stderr) == (1, f"process 1 has ended, or has not been heard of for 4 s: {ADVICE}")
    wait_for(lambda: not alive((tmp_path / "started").read_text()))

    (tmp_path / "slow").unlink()
    project.calls()
    status, stdout, stderr = project.run("--quality", "paper")
    assert (status, stderr) == (0, "")
    assert stdout.startswith("one: up to date\ntwo: ")
    assert list(project.numbers()) == ["one", "two"]
    assert not any("process" in name for name in project.files())


@pytest.mark.slow
def test_those_who_do_not_come_and_those_who_come_twice(tmp_path):
    project = Hasty(tmp_path, one=GOOD, two=SLEEPING)
    (tmp_path / "slow").touch()
    port, other = free_port(), free_port()
    ended = results(
        [project.join(port, process) for process in (1, 1)]
        + [project.join(other, process) for process in (0, 1, 1)]
    )
    assert [status for *_, status in ended] == [1] * 5
    for _, stderr, _ in ended[:2]:
        assert re.fullmatch(f"after 3 s not all processes had met at 127.0.0.1:{port}: .*{ADVICE}", stderr)
    assert ended[2][1] == f"two processes were started with --process-id 1: {ADVICE}"

    status, _, stderr = project.run("--distributed")
    assert status == 1
    assert "there is no cluster that JAX knows (SLURM, " in stderr


@pytest.mark.slow
def test_processes_that_want_something_else(tmp_path):
    project = Hasty(tmp_path, one=GOOD)
    port = free_port()
    for _, stderr, status in results([project.join(port, 0), project.join(port, 1, 2, "--quality", "paper")]):
        assert status == 1
        assert stderr.startswith("process 1 was started with other names, another quality, ")
    port = free_port()
    ended = results([project.join(port, 0), project.join(port, 1, 2, "--out", "elsewhere")])
    assert ended[1][1].endswith(
        f"or does not share its output folder: {ADVICE.replace('out,', 'elsewhere,')}"
    )


@pytest.mark.parametrize(
    ("said", "explanation"),
    [
        (
            "UNAVAILABLE: The following tasks are unhealthy (stopped sending heartbeats):\n2\n5\nThe",
            "process 2, 5 has ended, or has not been heard of for 20 s",
        ),
        (
            "UNAVAILABLE: Failed to send RPC to coordination service. Either the leader task",
            "process 0, the coordinator, has ended or cannot be reached any more",
        ),
        (
            "DEADLINE_EXCEEDED: Deadline Exceeded\n\nRPC: /xla.RegisterTask",
            "after 300 s not all processes had met",
        ),
        ("Something new", "Something new"),
    ],
)
def test_explanations(said, explanation):
    assert explain(said, Where("host:1", 2, 0)).startswith(explanation)


def test_what_processes_made_is_gathered(tmp_path):
    told = []
    store.record(tmp_path, "one", {"seconds": 1}, told.append)
    store.record(tmp_path, "two", {"seconds": 2}, told.append, process=1)
    store.record(tmp_path, "one", {"seconds": 3}, told.append, process=12)
    assert list(store.read_numbers(tmp_path)) == ["one"]
    store.gather(tmp_path, told.append)
    assert store.read_numbers(tmp_path) == {"one": {"seconds": 3}, "two": {"seconds": 2}}
    assert [path.name for path in tmp_path.iterdir()] == ["numbers.json"]
    assert not told
