"""Rates of devices beside the processor's and a bound of an H100, and differences of bits."""

import jax
import numpy as np
import pytest

from figures.shared.timing import device_rates

N = 4096


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
    row = device_rates.compare(name, device, cpu, (N, 16, 4), (N // 2, 8, 4), least=0.0)
    assert row.ulps == 0 and 0 < row.rate < row.bound and row.processor > 0
    assert row.exact == (name == "Halton, 2-D")


def test_there_are_no_rates_without_a_gpu():
    if all(device.platform == "cpu" for device in jax.devices()):
        assert device_rates.measure("draft") == {}
