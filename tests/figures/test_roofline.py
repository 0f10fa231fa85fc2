"""Operations counted in compiled programs, the bound that they are for an H100, and the command for GPUs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from figures.commands import gpu
from figures.shared.timing.h100 import H100, programs
from figures.shared.timing.operations import operations
from qmcjax import sequences

N = 4096
FLOATS = jax.ShapeDtypeStruct((N,), jnp.float32)
WORDS = jax.ShapeDtypeStruct((N,), jnp.uint32)


def counted(function, *args):
    return operations(jax.jit(function).lower(*args).compile())


def test_the_sum_is_that_of_xla():
    """XLA's own analysis has one number for all operations, and one for all bytes."""
    sequence = sequences.owen(sequences.sobol(2), key=1)
    compiled = jax.jit(lambda s, index: s(index)).lower(sequence, WORDS).compile()
    counts, analysis = operations(compiled), compiled.cost_analysis()
    assert counts.total == analysis["flops"]
    assert counts.bytes == analysis["bytes accessed"]
    assert counts.special == counts.float64 == counts.open_loops == 0


def test_kinds():
    counts = counted(lambda x, w: x * x + jnp.sin(x) / (w ^ (w >> 3)).astype(jnp.float32), FLOATS, WORDS)
    assert counts.float32 == 2 * N and counts.special == 2 * N
    assert counts.integer == 3 * N  # xor, shift, conversion
    assert counts.names >= {"multiply", "add", "sine", "divide", "convert"}
    with jax.enable_x64(True):
        wide = counted(lambda x: (x.astype(jnp.float64) * 0.3).astype(jnp.float32), FLOATS)
    assert wide.float64 == N and wide.integer == 4 * N  # two conversions, of two words each


def test_turns_of_loops():
    def looped(x, turns):
        return jax.lax.fori_loop(0, turns, lambda k, y: y * x, x)

    known = counted(lambda x: looped(x, 10), FLOATS)
    assert known.float32 == 10 * N and known.open_loops == 0 and known.bytes >= 10 * 3 * 4 * N
    unknown = counted(looped, FLOATS, jax.ShapeDtypeStruct((), jnp.int32))
    assert unknown.float32 == N and unknown.open_loops == 1


def test_the_branch_that_takes_longest_counts():
    def chosen(x):
        return jax.lax.cond(x[0] > 0, lambda x: x * x * x, lambda x: x + x, x)

    assert counted(chosen, FLOATS).float32 == 2 * N


def test_the_busiest_part_is_the_bound():
    """67 TFLOP/s, as the datasheet counts; 3.35 TB/s; half as many integers as instructions for floats."""
    assert H100.peak("float32") * 2 == pytest.approx(67e12, rel=2e-3)
    assert H100.peak("float64") * 2 == pytest.approx(34e12, rel=2e-2)
    counts = counted(lambda x: x * x, FLOATS)
    busy = H100.seconds(counts)
    assert max(busy, key=lambda part: busy[part]) == "memory"
    assert busy["memory"] == 2 * 4 * N / 3.35e12
    assert busy["issue"] == busy["float32"] == N / H100.peak("float32")


def test_units_in_the_last_place():
    one = np.float32([1.0, -1.0, 0.0, np.nan, np.inf])
    assert gpu.ulps(one, one) == 0
    assert gpu.ulps(one, np.float32([1.0, -1.0, -0.0, np.nan, np.inf])) == 0
    assert gpu.ulps(one[:2], np.nextafter(one[:2], np.float32(0))) == 1
    least = np.float32([np.finfo(np.float32).smallest_subnormal])
    assert gpu.ulps(least, -least) == 2
    assert gpu.ulps(one, np.float32([1.0, -1.0, 0.0, 1.0, np.inf])) > 2**20


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Halton, 2-D", "zone plate, Z"])
def test_two_devices_are_compared(monkeypatch, name):
    """With another processor as the device: the same bits."""
    monkeypatch.setattr(gpu, "LEAST", 0.0)
    cpu, device = jax.devices("cpu")
    row = gpu.compared(name, device, cpu, (N, 16, 4), (N // 2, 8, 4))
    assert row.ulps == 0 and min(row.rate, row.other) > 0 and row.bound > 1e9
    assert row.exact == (name == "Halton, 2-D")


@pytest.mark.slow
def test_all_operations_of_programs_are_tried(monkeypatch):
    monkeypatch.setattr(gpu, "NUMBERS", 1000)
    cpu, device = jax.devices("cpu")
    assert all(gpu.differing(name, device, cpu) == 0 for name in gpu.OPERATIONS)
    for make in list(programs(N, 16, 16).values())[2::3]:
        counts = operations(make().compiled())
        assert counts.names <= gpu.OPERATIONS.keys()
        assert counts.open_loops == 0


class Gpu:
    platform, device_kind = "gpu", "a GPU"


def found(monkeypatch, ulps, exact, off):
    """Run the command where a GPU is said to be, with made-up results."""
    monkeypatch.setattr(gpu.jax, "devices", lambda platform=None: [Gpu()])
    row = gpu.Row("name", 1e10, 1e11, 1e8, ulps, exact)
    monkeypatch.setattr(gpu, "compared", lambda *_: row)
    monkeypatch.setattr(gpu, "differing", lambda *_: off)
    monkeypatch.setattr(gpu, "torch_rates", lambda *_: {})
    return gpu.main([])


def test_the_command_tells_where_a_gpu_differs(monkeypatch, capsys):
    assert found(monkeypatch, 0, True, 1) == 0
    assert "10.0%" in capsys.readouterr().out
    assert found(monkeypatch, 3, False, 0) == 0
    assert "off by up to 3 ulp" in capsys.readouterr().out
    assert found(monkeypatch, 3, True, 0) == 1
    assert "points differ" in capsys.readouterr().err
    assert found(monkeypatch, 0, True, 2) == 1
    assert "more than 1: add" in capsys.readouterr().err


def test_the_command_without_a_gpu_says_so(capsys):
    if any(device.platform != "cpu" for device in jax.devices()):
        pytest.skip("there is one")
    assert gpu.main([]) == 1
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.startswith("no GPU: ") and printed.err.count("\n") == 1
