"""A member of a job of several processes, as JAX knows it: ``python -m figures.making.member``.

JAX ends a process whose job has lost another one, whatever it is doing. So this one does nothing but belong
to the job: the command line reads what it says, and how it ended (see :mod:`figures.making.job`). It computes
nothing, and leaves accelerators to those that do.
"""

import json
import os
import queue
import sys
import threading
from typing import Any

import jax
import numpy as np
from jax.experimental import multihost_utils

from figures.making.job import SAID


def main(options: dict[str, Any]) -> None:
    """Join the job, say so, and meet the others when told, until told to leave."""
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
    os._exit(1)  # The command line ended: so does this, without a word to the others, who will miss it.


def _say(**what: Any) -> None:
    # JAX prints, too, and not always to the end of a line.
    print(f"\n{SAID}{json.dumps(what)}", flush=True)


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
