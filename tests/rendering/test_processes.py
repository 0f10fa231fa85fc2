"""Images by several processes are those of one, bit by bit; killed, they go on from a checkpoint."""

import hashlib
import os
import signal
import subprocess
import sys

import jax
import numpy as np
import pytest
from tables import free_port

import analysis
import qmcjax as qj
from qmcjax import orders, samplers, scenes, sequences

pytestmark = pytest.mark.slow

WIDTH, HEIGHT, SPP = 40, 25, 16
LONG = 2**12

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
for name, value in test_processes.computed(mesh).items():
    print("made", name, value, flush=True)
jax.distributed.shutdown()
"""

KEEP = """
from qmcjax.core import checkpoints
from qmcjax.rendering import _render
checkpoints.EVERY, checkpoints.SHARE, _render._CALL = 0.0, float("inf"), 2**14
test_processes.kept(mesh, paths[0], lambda part: print("part", part, flush=True))
"""


def one_pass(key):
    order = orders.hilbert(WIDTH, HEIGHT)
    return samplers.contiguous(order, sequences.digital_shift(sequences.sobol(2), key), SPP)


def computed(mesh):
    """Return digests of what is computed over devices."""
    scene, size = scenes.disc(), (WIDTH, HEIGHT)
    found = {
        "image": qj.render(scene, one_pass(jax.random.key(1)), *size, SPP, mesh=mesh),
        "adaptive": qj.render_adaptive(scene, one_pass(jax.random.key(1)), *size, SPP, mesh=mesh),
        "passes": qj.render_passes(scene, samplers.randomized(one_pass, 1), *size, 2, mesh=mesh),
        "sweep": sweep(mesh),
        "reference": qj.estimated_reference(scene, *size, 16, 1, mesh=mesh),
        "derivatives": derivatives(mesh),
    }
    return {name: digest(value) for name, value in found.items()}


def derivatives(mesh):
    """Return those of an image and an integral, forward and in reverse."""
    sampler, sequence = samplers.independent(sequences.sobol(2), 1, "xor"), sequences.sobol(2)

    def energy(f):
        return (qj.render(scenes.zone_plate(f), sampler, WIDTH, HEIGHT, SPP, mesh=mesh) ** 2).sum()

    def mean(x):
        return qj.integrate(lambda p: jax.numpy.exp(-((p - x) ** 2).sum(-1)), sequence, 2**21 + 77, mesh=mesh)

    at = jax.numpy.float32(20), jax.numpy.float32(0.3)
    return [d(f)(x) for f, x in zip((energy, mean), at, strict=True) for d in (jax.jacfwd, jax.grad)]


def sweep(mesh, **given):
    """Return the errors of a sweep: four images, which three processes cannot share evenly."""
    compared = {
        name: samplers.independent(sequences.sobol(2), key, "xor") for name, key in (("a", 1), ("b", 2))
    }
    table = analysis.convergence(
        scenes.disc(), compared, [1, 4], width=WIDTH, height=HEIGHT, repeats=1, mesh=mesh, **given
    )
    assert [(row.sampler, row.spp) for row in table.rows] == [("a", 1), ("a", 4), ("b", 1), ("b", 4)]
    assert all(row.seconds > 0 for row in table.rows)
    return [tuple(row.errors.values()) for row in table.rows]


def digest(values):
    sha = hashlib.sha256()
    for leaf in jax.tree.leaves(values):
        sha.update(np.asarray(leaf).tobytes())
    return sha.hexdigest()


def kept(mesh, path, progress):
    sampler = samplers.independent(sequences.sobol(2), 1, "xor")
    return qj.render(
        scenes.disc(), sampler, WIDTH, HEIGHT, LONG, mesh=mesh, checkpoint=path, progress=progress
    )


def start(code, *paths, count):
    port = free_port()
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(sys.path),
        "JAX_COMPILATION_CACHE_DIR": str(jax.config.values["jax_compilation_cache_dir"]),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    each = [[str(port), str(count), str(process)] for process in range(count)]
    if len(paths) > 1:
        each = [[*arguments, path] for arguments, path in zip(each, paths, strict=True)]
    else:
        each = [[*arguments, *paths] for arguments in each]
    return [
        subprocess.Popen(
            [sys.executable, "-c", START + code, *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for arguments in each
    ]


@pytest.mark.parametrize("count", [2, 3])
def test_as_by_one_process(count):
    expected = [f"made {name} {value}" for name, value in computed(None).items()]
    for process in start(COMPUTE, count=count):
        stdout, stderr = process.communicate(timeout=120)
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
    processes = start(KEEP, str(mine), str(tmp_path / "yours"), count=2)
    for process in processes:
        _, stderr = process.communicate(timeout=120)
        assert process.returncode == 1
        assert "checkpoint must be a file that all processes of the mesh see" in stderr
