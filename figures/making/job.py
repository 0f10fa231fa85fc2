"""A job of several processes, on one machine or many, that ends as a whole when one of them is lost."""

import hashlib
import json
import os
import re
import subprocess
import sys
import threading
from typing import Any, NamedTuple

WAIT = 300
"""Seconds until all processes must have come."""

HEARTBEAT = 20
"""Seconds without a sign of life after which a process is taken for dead."""

SAID = "figures: "
"""Begins each line that a member of a job says."""


class Where(NamedTuple):
    """Which process of which job this is; what is None is asked of the cluster."""

    coordinator: str | None = None
    processes: int | None = None
    process: int | None = None


class Job:
    """A process' place among those of a job."""

    def __init__(self, where: Where, advice: str) -> None:
        """Join a job. If that fails, or one is lost, this process ends with a message and advice."""
        self._where, self._advice = where, advice
        self._left = False
        options = {**where._asdict(), "wait": WAIT, "heartbeat": HEARTBEAT}
        self._member = subprocess.Popen(
            [sys.executable, "-m", "figures.making.member", json.dumps(options)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            start_new_session=True,  # Ctrl-C is this process' business.
        )
        self._watching = threading.Thread(target=self._watch, daemon=True)
        self._watching.start()
        self.process, self.processes = self._heard("joined")

    def meet(self, about: Any) -> None:
        """Wait for all processes, and end this one unless all are about the same, made of what JSON knows."""
        self._tell(hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest())
        words = self._heard("met")
        others = [str(k) for k, word in enumerate(words) if word != words[0]]
        if others:
            self._end(
                f"process {', '.join(others)} was started with other names, another quality, other code or "
                "versions of libraries than process 0, or does not share its output folder"
            )

    def leave(self) -> None:
        """Leave the job after all have met for the last time."""
        self._left = True
        self._tell("leave")
        self._member.wait()

    def desert(self) -> None:
        """Leave the job at once: the others will miss this process."""
        self._left = True
        self._member.kill()
        self._member.wait()

    def _tell(self, word: str) -> None:
        assert self._member.stdin is not None
        try:
            print(json.dumps(word), file=self._member.stdin, flush=True)
        except BrokenPipeError:
            self._watching.join()

    def _heard(self, key: str) -> Any:
        assert self._member.stdout is not None
        for line in self._member.stdout:
            if line.startswith(SAID):
                return json.loads(line.removeprefix(SAID))[key]
        self._watching.join()
        raise AssertionError("the job ended, but not this process")

    def _watch(self) -> None:
        """Wait until the member ends, and end with it, whatever else goes on."""
        assert self._member.stderr is not None
        said = self._member.stderr.read()
        self._member.wait()
        if not self._left:
            self._end(explained(said, self._where))

    def _end(self, why: str) -> None:
        print(f"{why}: {self._advice}", file=sys.stderr, flush=True)
        self._left = True
        self._member.kill()
        os._exit(1)  # This may not be the main thread. Workers end with this process.


def explained(said: str, where: Where) -> str:
    """Return in a sentence why JAX ended a member of a job, from what it said; all of that if it is new."""
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
