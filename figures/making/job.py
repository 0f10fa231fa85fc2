"""A job of several processes, on one machine or many, which share the figures or end together.

If a job loses a process, JAX ends all others, whatever they are doing. The process that joins the job is
therefore not the command line but a separate member, ``python -m figures.making.job``, which computes nothing
and uses no accelerator: the command line reads its messages and notices when it ends.
"""

import hashlib
import json
import os
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from figures.making import store
from figures.making.finished_cells import take
from figures.making.updating import forget_cells, make, missing, outdated, say, warn
from figures.making.workers import Failed, Task, run

WAIT = 300
"""Seconds until all processes must have joined."""

HEARTBEAT = 20
"""Seconds without a heartbeat after which a process counts as lost."""

VISIBLE = 60
"""Seconds after which a file written to a shared folder is visible on all machines."""

SAID = "figures: "
"""The prefix of each message from a member of a job."""


class Where(NamedTuple):
    """Which process of which job this is; JAX asks the cluster for fields that are None."""

    coordinator: str | None = None
    processes: int | None = None
    process: int | None = None


class JobError(Exception):
    """A job has ended; the message says why."""


class Job:
    """The connection of a process to its job."""

    def __init__(self, where: Where) -> None:
        """Join a job. Raises JobError, as do all methods, if this fails or another process is lost."""
        self._where = where
        self._errors = tempfile.TemporaryFile("w+", errors="replace")
        self._member = subprocess.Popen(
            [
                sys.executable,
                "-m",
                __name__,
                json.dumps({**where._asdict(), "wait": WAIT, "heartbeat": HEARTBEAT}),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            errors="replace",
            start_new_session=True,  # Only this process handles Ctrl-C.
        )
        self.process, self.processes = self._hear("joined")

    def meet(self, about: Any) -> None:
        """Wait for all processes; ``about``, made of JSON values, must be the same in all of them."""
        self._tell(hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest())
        words = self._hear("met")
        others = [str(k) for k, word in enumerate(words) if word != words[0]]
        if others:
            raise JobError(
                f"process {', '.join(others)} was started with other names, another quality, other code or "
                "versions of libraries than process 0, or does not share its output folder"
            )

    def check(self) -> None:
        """Raise JobError if the job has ended."""
        if self._member.poll() is not None:
            self._errors.seek(0)
            raise JobError(explain(self._errors.read(), self._where))

    def leave(self) -> None:
        """Leave the job after the last meeting."""
        self._tell("leave")
        self._member.wait()

    def end(self) -> None:
        """Leave the job at once, if it is not left yet; the other processes will notice."""
        self._member.kill()
        self._member.wait()

    def _tell(self, word: str) -> None:
        assert self._member.stdin is not None
        try:
            print(json.dumps(word), file=self._member.stdin, flush=True)
        except BrokenPipeError:
            self._explain()

    def _hear(self, key: str) -> Any:
        assert self._member.stdout is not None
        for line in self._member.stdout:
            if line.startswith(SAID):
                return json.loads(line.removeprefix(SAID))[key]
        self._explain()

    def _explain(self) -> None:
        self._member.wait()
        self.check()


def explain(said: str, where: Where) -> str:
    """Return in one sentence why JAX ended a member of a job, or JAX's own message if it is unknown."""
    if found := re.search(r"stopped sending heartbeats\):\s*([\d\s,]+)", said):
        lost = ", ".join(found[1].replace(",", " ").split())
        return f"process {lost} has ended, or has not been heard of for {HEARTBEAT} s"
    if found := re.search(r"(\d+) unexpectedly tried to connect with a different incarnation", said):
        return f"two processes were started with --process-id {found[1]}"
    if "Failed to send RPC to coordination service" in said:
        return "process 0, the coordinator, has ended or cannot be reached any more"
    if "DEADLINE_EXCEEDED" in said and "RegisterTask" in said:
        place = f" at {where.coordinator}" if where.coordinator else ""
        return (
            f"after {WAIT} s not all processes had met{place}: one has not come, two have the same "
            "--process-id, or process 0 cannot be reached there"
        )
    if "coordinator_address should be defined" in said:
        return (
            "there is no cluster that JAX knows (SLURM, Open MPI, Kubernetes, Cloud TPU), so that "
            "--coordinator, --processes and --process-id are needed"
        )
    return said


def share(tasks: Sequence[Task], folder: Path, jobs: int, job: Job) -> list[str]:
    """Make this process' share of the figures, like :func:`figures.making.updating.update`.

    Each process makes the next figure that no other has claimed, and then helps with the figures of others.
    Finally, process 0 makes the figures that run alone, and returns the failures of all processes.
    """
    place = folder / ".job"
    token = place / "token"
    if job.process == 0:
        store.gather(folder, warn)
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        store.write(token, uuid.uuid4().hex.encode())
    about = [(task.name, task.quality, task.fingerprint) for task in tasks]
    job.meet(about)
    _wait_for(token.exists, job)
    left = outdated(tasks, folder)
    # All processes wait here before one of them changes files that others read.
    job.meet([about, token.read_text() if token.exists() else None, [task.name for task in left]])

    together = [
        task._replace(place=task.place._replace(claims=place / task.name))
        for task in left
        if task.place is not None and not task.alone
    ]
    failed = make(together, folder, jobs, job.process, lambda task: take(place / task.name), job.check)
    _help(together, jobs, job)
    job.meet("made")
    if job.process:
        return failed
    shutil.rmtree(place, ignore_errors=True)

    def lost() -> list[str]:
        store.gather(folder, warn)
        return [task.name for task in missing(together, folder)]

    _wait_for(lambda: set(lost()) <= set(failed), job)
    failed = lost() + make([task for task in left if task.alone], folder, jobs, check=job.check)
    forget_cells(folder, {task.name for task in tasks} - set(failed))
    return failed


def _help(tasks: Sequence[Task], jobs: int, job: Job) -> None:
    """Compute cells of figures that other processes are making, until all are made."""
    helped: set[str] = set()
    while places := {task: task.place for task in tasks if task.place and not task.place.ended()}:
        ready = [task for task, place in places.items() if place.begun() and task.name not in helped]
        for task, result in run(ready, jobs, watch=lambda _: job.check()):
            if isinstance(result, Failed) and not places[task].ended():
                say(result.trace.rstrip(), sys.stderr)
                places[task].end()
        helped.update(task.name for task in ready)
        job.check()
        time.sleep(0.2)


def _wait_for(condition: Callable[[], bool], job: Job) -> None:
    """Wait until the files of other processes are visible: network folders may be late."""
    end = time.monotonic() + VISIBLE
    while not condition() and time.monotonic() < end:
        job.check()
        time.sleep(0.5)


def belong(options: dict[str, Any]) -> None:
    """Join the job through JAX, report it, and meet the other members on request, until told to leave."""
    import jax
    import numpy as np
    from jax.experimental import multihost_utils

    jax.config.update("jax_platforms", "cpu")
    jax.config.update("jax_num_cpu_devices", 1)
    jax.distributed.initialize(
        options["coordinator"],
        options["processes"],
        options["process"],
        local_device_ids=[0],
        initialization_timeout=options["wait"],
        heartbeat_timeout_seconds=options["heartbeat"],
    )
    words: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(words,), daemon=True).start()
    _say(joined=[jax.process_index(), jax.process_count()])
    while (word := words.get()) != "leave":
        every = multihost_utils.process_allgather(np.frombuffer(bytes.fromhex(word), np.uint32))
        _say(met=[each.tobytes().hex() for each in every.reshape(jax.process_count(), -1)])
    jax.distributed.shutdown()


def _listen(words: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        words.put(json.loads(line))
    os._exit(1)  # The command line ended: end as well; the other members will notice.


def _say(**what: Any) -> None:
    # JAX also prints, and does not always end the line.
    print(f"\n{SAID}{json.dumps(what)}", flush=True)


if __name__ == "__main__":
    belong(json.loads(sys.argv[1]))
