"""Operations counted in compiled programs, the bound that they are for an H100, and devices compared."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from figures.shared.timing import device_rates
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
    """67 TFLOP/s, as the datasheet counts, which two operations of each instruction may be; 3.35 TB/s."""
    assert H100.peak("float32") == H100.peak("issue") == pytest.approx(67e12, rel=2e-3)
    assert H100.peak("float64") == pytest.approx(34e12, rel=2e-2)
    counts = counted(lambda x: x * x, FLOATS)
    busy = H100.seconds(counts)
    assert max(busy, key=lambda part: busy[part]) == "memory"
    assert busy["memory"] == 2 * 4 * N / 3.35e12
    assert busy["issue"] == busy["float32"] == N / H100.peak("float32")


def test_units_in_the_last_place():
    one = np.float32([1.0, -1.0, 0.0, np.nan, np.inf])
    assert device_rates.ulps(one, one) == 0
    assert device_rates.ulps(one, np.float32([1.0, -1.0, -0.0, np.nan, np.inf])) == 0
    assert device_rates.ulps(one[:2], np.nextafter(one[:2], np.float32(0))) == 1
    least = np.float32([np.finfo(np.float32).smallest_subnormal])
    assert device_rates.ulps(least, -least) == 2
    assert device_rates.ulps(one, np.float32([1.0, -1.0, 0.0, 1.0, np.inf])) > 2**20


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Halton, 2-D", "zone plate, Z"])
def test_two_devices_are_compared(name):
    """With another processor as the device: the same bits."""
    cpu, device = jax.devices("cpu")
    row = device_rates.compared(name, device, cpu, (N, 16, 4), (N // 2, 8, 4), least=0.0)
    assert row.ulps == 0 and 0 < row.rate < row.bound and row.processor > 0
    assert row.exact == (name == "Halton, 2-D")


@pytest.mark.slow
def test_all_operations_of_programs_are_tried(monkeypatch):
    monkeypatch.setattr(device_rates, "NUMBERS", 1000)
    cpu, device = jax.devices("cpu")
    assert all(device_rates.differing(name, device, cpu) == 0 for name in device_rates.OPERATIONS)
    for make in list(programs(N, 16, 16).values())[2::3]:
        counts = operations(make().compiled())
        assert counts.names <= device_rates.OPERATIONS.keys()
        assert counts.open_loops == 0


def test_there_are_no_rates_without_a_gpu():
    if all(device.platform == "cpu" for device in jax.devices()):
        assert device_rates.measured("draft") == {}
