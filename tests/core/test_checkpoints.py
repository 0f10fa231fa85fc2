"""Files with the state of a computation: whole at any time, and taken for no other computation's."""

import os
import resource
import socket
import subprocess
import time

import numpy as np
import pytest

from qmcjax import scenes
from qmcjax.core import checkpoints
from qmcjax.core.checkpoints import Checkpoint, begin

DISC = scenes.disc()


def keep(path, **state):
    begin(path, scene=DISC, spp=4).write(**state)


def test_what_was_written_is_read(tmp_path):
    path = tmp_path / "state"
    first = begin(path, scene=DISC, spp=4)
    assert first.state == {}
    assert path.is_file()
    first.write(total=np.arange(3.0), done=7)
    found = begin(str(path), scene=scenes.disc(), spp=4).state
    np.testing.assert_array_equal(found["total"], np.arange(3.0))
    assert (int(found["done"]), len(found)) == (7, 2)
    assert os.listdir(tmp_path) == ["state"]


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"scene": DISC, "spp": 8}, r"where spp was 4, is 8: give another path"),
        ({"scene": scenes.disc((0.5, 0.5), 0.1), "spp": 4}, "where scene is another one:"),
        ({"scene": DISC, "sampler": DISC}, "where spp was 4, is None, sampler is another one:"),
    ],
)
def test_another_computation_is_refused(tmp_path, other, message):
    keep(tmp_path / "state", done=1)
    with pytest.raises(
        ValueError, match=f"^checkpoint must belong to this computation, got '.*state', {message}"
    ):
        begin(tmp_path / "state", **other)


def test_another_version_is_refused(tmp_path, monkeypatch):
    keep(tmp_path / "state", done=1)
    ours = checkpoints.environment()
    monkeypatch.setattr(checkpoints, "environment", lambda: ours | {"qmcjax": "0.0.1"})
    with pytest.raises(ValueError, match=r"qmcjax was \d.*, sources .*, is 0\.0\.1:"):
        keep(tmp_path / "state")


def test_another_kind_of_device_is_refused(tmp_path, monkeypatch):
    keep(tmp_path / "state", done=1)
    kind = checkpoints.devices.kind(None)
    monkeypatch.setattr(checkpoints.devices, "kind", lambda mesh: "abacus")
    with pytest.raises(ValueError, match=f"where device was {kind}, is abacus:"):
        keep(tmp_path / "state")


def test_labels(tmp_path):
    """Any text, which counts where there is no foreign code, too."""
    path, long = tmp_path / "state", "v2 " * 40
    keep(path, done=1)
    with pytest.raises(ValueError, match=f"where label was None, is '{long}': give"):
        keep(Checkpoint(path, long))
    path.unlink()
    keep(Checkpoint(path, long), done=1)
    with pytest.raises(ValueError, match=f"where label was '{long}', is None: give"):
        keep(path)
    assert begin(Checkpoint(str(path), long), scene=DISC, spp=4).state["done"] == 1


@pytest.mark.parametrize("kind", ["empty", "text", "cut", "flipped", "array", "archive", "pickle"])
def test_a_damaged_or_foreign_file_is_refused_and_stays(tmp_path, kind):
    path = tmp_path / "state"
    keep(path, total=np.arange(1000.0))
    whole = path.read_bytes()
    if kind == "array":
        with open(path, "wb") as file:
            np.save(file, np.arange(3))
    elif kind == "archive":
        with open(path, "wb") as file:
            np.savez(file, header=np.array('{"format": "another"}'))
    elif kind == "pickle":
        with open(path, "wb") as file:
            np.savez(file, header=np.array([{}], dtype=object), allow_pickle=True)
    else:
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        path.write_bytes({"empty": b"", "text": b"hello", "cut": whole[:middle], "flipped": flipped}[kind])
    before = path.read_bytes()
    with pytest.raises(ValueError, match=r"checkpoint must be a checkpoint file, got .* delete it"):
        keep(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("path", "error", "message"),
    [
        (3, TypeError, "must be the path of a file or a Checkpoint, got 3"),
        (Checkpoint(3, "v1"), TypeError, "must be the path of a file or a Checkpoint, got 3"),
        (Checkpoint("state", 1), TypeError, "must have a str as label, got 1"),
        (Checkpoint(".", "v1"), ValueError, r"must be the path of a file, got a folder: '\.'"),
        ("", ValueError, r"must be the path of a file, got a folder: '\.'"),
        (".", ValueError, r"must be the path of a file, got a folder: '\.'"),
        (
            "missing/state",
            ValueError,
            "must be the path of a file, got one in a folder that is not there: 'missing/state'",
        ),
    ],
)
def test_what_is_no_path_of_a_file(tmp_path, monkeypatch, path, error, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=f"checkpoint {message}"):
        begin(path, spp=1)


def test_a_full_disk_leaves_the_last_one(tmp_path):
    """The limit of a file's size makes a write fail in the middle, as a full disk does."""
    path = tmp_path / "state"
    held = begin(path, spp=1)
    held.write(total=np.arange(10.0))
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2 * len(before), hard))
    try:
        with pytest.warns(
            RuntimeWarning, match=r"checkpoint '.*' cannot be written, the previous one stays: .*large"
        ):
            held.write(total=np.zeros(10_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["state"]
    held.write(total=np.zeros(10_000))
    assert begin(path, spp=1).state["total"].shape == (10_000,)


def test_only_what_killed_processes_left_is_cleared_away(tmp_path):
    """What another run of the same, here or on another machine, is just writing stays."""
    path, here = tmp_path / "state[1]", socket.gethostname()
    keep(path, done=1)
    ended = subprocess.Popen(["true"])
    ended.wait()
    left = [f".state[1].part-{ended.pid}-{here}", ".state[1].part-99-far-away", ".state[1].part-old"]
    stays = [f".state[1].part-{os.getppid()}-{here}", ".state[1].part-98-far-away", ".state1.part-old"]
    for name in left + stays:
        (tmp_path / name).write_bytes(b"half")
    for name in left[1:] + stays[2:]:
        os.utime(tmp_path / name, (0, time.time() - checkpoints.LEFT - 60))
    keep(path, done=2)
    assert sorted(os.listdir(tmp_path)) == sorted([*stays, "state[1]"])


def test_what_is_being_written_is_not_cleared_away(tmp_path, monkeypatch):
    """Another run of the same begins meanwhile; the file says who writes it."""
    path, seen = tmp_path / "state", []
    held = begin(path, spp=1)
    held.write(done=0)

    def meanwhile(file):
        begin(path, spp=1)
        seen.extend(os.listdir(tmp_path))

    monkeypatch.setattr(checkpoints.os, "fsync", meanwhile)
    held.write(done=1)
    assert begin(path, spp=1).state["done"] == 1
    assert sorted(seen) == [f".state.part-{os.getpid()}-{socket.gethostname()}", "state"]


def test_writes_take_a_small_share_of_the_time(tmp_path, monkeypatch):
    monkeypatch.setattr(checkpoints, "EVERY", 0.0)
    held = begin(tmp_path / "state", spp=1)
    assert held.due()
    monkeypatch.setattr(checkpoints.os, "fsync", lambda file: time.sleep(0.05))
    held.write(done=1)
    assert not held.due()
    assert held._next - time.monotonic() > 0.5
    monkeypatch.setattr(checkpoints, "EVERY", 60.0)
    assert not begin(tmp_path / "state", spp=1).due()


def test_a_loop_inside_another_keeps_its_part(tmp_path):
    held = begin(tmp_path / "state", spp=1)
    checkpoints.Part(held, "pass", images=np.ones(2)).write(row=3)
    found = begin(tmp_path / "state", spp=1)
    assert sorted(found.state) == ["images", "pass.row"]
    inner = checkpoints.Part(found, "pass")
    assert list(inner.state) == ["row"] and int(inner.state["row"]) == 3
