"""Images by several processes are those of one, bit by bit; killed, they go on from a checkpoint."""

import hashlib
import signal
import subprocess
import sys
from functools import partial

import jax
import numpy as np
import pytest
import tables
from test_sharding import DIFFERENTIATED, SPREAD, compiled_derivative

import qmcjax as qj
from qmcjax import samplers, scenes, sequences

pytestmark = pytest.mark.slow

COMPUTED = (
    *("render", "render_adaptive", "render_passes", "convergence", "estimated_reference"),
    *("derivative of render", "derivative of integrate"),
)

START = """
import sys
import jax
jax.config.update("jax_num_cpu_devices", 1)
port, processes, process, *paths = sys.argv[1:]
jax.distributed.initialize(f"127.0.0.1:{port}", int(processes), int(process), initialization_timeout=60)
import test_processes
mesh = jax.make_mesh((jax.device_count(),), ("devices",))
"""

COMPUTE = """
for name, value in test_processes.computed(mesh, *paths).items():
    print("made", name, value, flush=True)
jax.distributed.shutdown()
"""

KEEP = """
from qmcjax.core import backends, checkpoints
checkpoints.EVERY, checkpoints.SHARE = 0.0, float("inf")
backends.BY_PLATFORM["cpu"] = backends.CPU._replace(samples=2**14)
test_processes.kept(mesh, paths[0], lambda part: print("part", part, flush=True))
"""


def computed(mesh, *names):
    """Return digests of what is computed over devices."""
    derivatives = {name: partial(compiled_derivative, make) for name, make in DIFFERENTIATED.items()}
    of = SPREAD | {f"derivative of {name}": call for name, call in derivatives.items()}
    return {name: digest(of[name](mesh=mesh)) for name in names}


def digest(values):
    sha = hashlib.sha256()
    for leaf in jax.tree.leaves(values):
        sha.update(np.asarray(leaf).tobytes())
    return sha.hexdigest()


def kept(mesh, path, progress):
    sampler = samplers.independent(sequences.sobol(2), 1, "xor")
    return qj.render(scenes.disc(), sampler, 40, 25, 2**12, mesh=mesh, checkpoint=path, progress=progress)


def start(code, *paths, count, each=None):
    """Start processes with the same arguments, or each with one of its own."""
    port = tables.free_port()
    given = [paths] * count if each is None else [(path,) for path in each]
    command = [sys.executable, "-c", START + code, str(port), str(count)]
    pipes = dict(env=tables.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    return [subprocess.Popen([*command, str(k), *more], **pipes) for k, more in enumerate(given)]


def test_as_by_one_process():
    """Three cannot share anything evenly."""
    expected = [f"made {name} {value}" for name, value in computed(None, *COMPUTED).items()]
    for process in start(COMPUTE, *COMPUTED, count=3):
        stdout, stderr = process.communicate(timeout=300)
        assert process.returncode == 0, stderr
        assert [line for line in stdout.splitlines() if line.startswith("made ")] == expected


def test_a_checkpoint_of_all(tmp_path):
    """Killed in two processes, an image is finished by one, to the same bits."""
    path = str(tmp_path / "state")
    processes = start(KEEP, path, count=2)
    for process in processes:
        while not process.stdout.readline().startswith("part"):
            assert process.poll() is None, process.stderr.read()
    reports = []
    for process in processes:
        process.kill()
        stdout, _ = process.communicate()
        assert process.returncode == -signal.SIGKILL
        reports += [float(line.split()[1]) for line in stdout.splitlines() if line.startswith("part")]
    parts = []
    image = kept(None, path, parts.append)
    assert len(parts) >= 1 and parts[0] > max(reports, default=0.0)
    whole = kept(None, tmp_path / "another", None)
    np.testing.assert_array_equal(image, whole)


def test_a_checkpoint_that_not_all_see(tmp_path):
    mine = tmp_path / "mine"
    jax.block_until_ready(kept(None, mine, None))
    processes = start(KEEP, count=2, each=[str(mine), str(tmp_path / "yours")])
    for process in processes:
        _, stderr = process.communicate(timeout=300)
        assert process.returncode == 1
        assert "checkpoint must be a file that all processes of the mesh see" in stderr
