"""Our samplers for programs without JAX."""

import numpy as np
import pytest
import tables
from refusals import refused

from qmcjax import orders, samplers, sequences
from qmcjax.bridges import PlainSampler

OWEN = sequences.owen(sequences.sobol(5), key=1)
CURVE = samplers.contiguous(orders.hilbert(20, 18), OWEN, spp=12)


def numbers(plain, x, y, sample, kinds):
    plain.start((x, y), sample)
    found = []
    for kind in kinds:
        found += [plain.get1d()] if kind == 1 else plain.get2d()
    return found


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_numbers_are_the_samplers_in_any_order(dtype):
    """Tables at the lower and right edge, and of the last samples, begin early enough to be whole."""
    plain, rng = PlainSampler(CURVE, dtype), np.random.default_rng(1)
    x, y, s = rng.integers(0, 20, 60), rng.integers(0, 18, 60), rng.integers(0, 12, 60)
    x[0], y[0], s[0] = 19, 17, 11
    expected = np.asarray(CURVE(x, y, s, tuple(range(5)), dtype))
    for k in range(60):
        kinds = ((2, 1, 2), (1, 1, 1, 2), (2, 2, 1))[k % 3]
        assert numbers(plain, x[k], y[k], s[k], kinds) == expected[k].tolist()
    assert type(numbers(plain, 0, 0, 0, [1])[0]) is float


def test_arrays_are_the_samplers():
    plain = PlainSampler(CURVE)
    y, x, s = np.ogrid[:18, :20, :3]
    found = plain.array(20, 18, 3, (4, 0))
    assert found.dtype == np.float32 and np.array_equal(found, CURVE(x, y, s, (4, 0)))
    shared = np.from_dlpack(found)
    assert shared.__array_interface__["data"] == found.__array_interface__["data"]


@pytest.mark.slow
@pytest.mark.parametrize("name", list(tables.SAMPLERS))
def test_every_sampler_has_its_numbers(name):
    sampler = tables.SAMPLERS[name]
    plain = PlainSampler(sampler)
    width, height, spp = (min(limit, 20) for limit in sampler.limits)
    where = np.array([(0, 0, 0), (width - 1, height // 2, spp - 1)], np.uint32)
    expected = np.asarray(sampler(*where.T, tuple(range(sampler.dims))))
    for (x, y, s), points in zip(where.tolist(), expected.tolist(), strict=True):
        assert numbers(plain, x, y, s, [1] * sampler.dims) == points


def test_tables_are_made_once(monkeypatch):
    from qmcjax.bridges import _plain

    made = []

    def counted(sampler, corner, size, first, count, dims, dtype):
        made.append((corner, first))
        return np.zeros((*size[::-1], count, len(dims)), dtype)

    monkeypatch.setattr(_plain, "pixel_points", counted)
    plain = PlainSampler(samplers.independent(sequences.sobol(2), key=1))
    for y in range(32):
        for x in range(48):
            for s in range(16):
                plain.start((x, y), s)
    assert len(made) == len(set(made)) == 2 * 3 * 2
    # The last samples are in a table that ends with them; there are none beyond.
    PlainSampler(CURVE).start((19, 17), 11)
    assert made[-1] == ((16, 16), 12 - 8)
    # With hundreds of dimensions tables have few pixels.
    PlainSampler(samplers.independent(sequences.sobol(400), key=1)).start((5, 6), 9)
    assert made[-1] == ((4, 4), 8)


def test_there_are_no_more_coordinates_than_the_samplers():
    plain = PlainSampler(samplers.function(lambda x, y, s: np.full((*s.shape, 3), 0.25, np.float32), 3))
    with pytest.raises(ValueError, match=r"call start\(pixel, sample\) before"):
        plain.get1d()
    plain.start((3, 4), 5)
    assert plain.get2d() == (0.25, 0.25)
    with pytest.raises(ValueError, match="have 2 more coordinates, got 2 of dims=3 taken"):
        plain.get2d()
    assert plain.get1d() == 0.25


test_wrong_arguments_are_named = refused(
    (lambda: PlainSampler(CURVE).start(3, 0), TypeError, "pixel must be column and row, got 3"),
    (lambda: PlainSampler(CURVE).start((32, 0), 0), ValueError, r"pixel must be .* \[0, 31\], got 32"),
    (lambda: PlainSampler(CURVE).start((0, 0), 12), ValueError, r"sample must be .* \[0, 11\], got 12"),
    (lambda: PlainSampler(CURVE).array(9, 9, 1), ValueError, "width, height must be the order's 20 x 18"),
)


def test_torch_takes_arrays_over():
    torch = pytest.importorskip("torch")
    points = PlainSampler(CURVE).array(20, 18, 2)
    shared = torch.from_dlpack(points)
    assert shared.data_ptr() == points.ctypes.data and shared.shape == (18, 20, 2, 5)
    ours = OWEN.points(16)
    assert np.array_equal(torch.from_dlpack(ours).numpy(), ours)
