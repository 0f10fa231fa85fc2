"""Our samplers for programs without JAX, and other libraries' generators as sequences."""

from types import SimpleNamespace

import numpy as np
import pytest
import tables
from refusals import refused
from scipy.integrate import qmc_quad
from scipy.stats import qmc

import analysis
from qmcjax import bridges, orders, samplers, sequences
from qmcjax.bridges import PlainSampler, SequenceEngine, tabulate

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
    (lambda: PlainSampler(3), TypeError, "sampler must be a sampler"),
    (lambda: PlainSampler(CURVE, "float16"), ValueError, "dtype must be float32 or float64"),
    (lambda: PlainSampler(CURVE).start(3, 0), TypeError, "pixel must be column and row, got 3"),
    (lambda: PlainSampler(CURVE).start((32, 0), 0), ValueError, r"pixel must be .* \[0, 31\], got 32"),
    (lambda: PlainSampler(CURVE).start((0, 0), 12), ValueError, r"sample must be .* \[0, 11\], got 12"),
    (lambda: PlainSampler(CURVE).array(9, 9, 1), ValueError, "width, height must be the order's 20 x 18"),
    (lambda: tabulate(OWEN, 4), TypeError, r"generator must be one of points, with random\(n\)"),
    (lambda: SequenceEngine(3), TypeError, "sequence must be a sequence"),
)


def test_torch_takes_arrays_over():
    torch = pytest.importorskip("torch")
    points = PlainSampler(CURVE).array(20, 18, 2)
    shared = torch.from_dlpack(points)
    assert shared.data_ptr() == points.ctypes.data and shared.shape == (18, 20, 2, 5)
    ours = OWEN.points(16)
    assert np.array_equal(torch.from_dlpack(ours).numpy(), ours)


def replicated(points):
    """Return what is asked of a discrete distribution of QMCPy."""
    return SimpleNamespace(gen_samples=lambda n: points[..., :n, :])


def test_distributions_of_qmcpy_are_sequences():
    points = np.random.default_rng(1).random((16, 3))
    sequence = tabulate(replicated(points), 8)
    assert sequence.size == 8 and np.array_equal(
        sequence.points(8, dtype=np.float64), points[:8] * 2**32 // 1 / 2**32
    )


test_distributions_of_qmcpy_must_draw_points = refused(
    (np.zeros((2, 8, 3)), ValueError, r"generator must draw points of shape \(8, dims\), got .*\(2, 8, 3\)"),
    (np.full((8, 2), -0.5), ValueError, r"generator: points must be in \[0, 1\)"),
    (np.ones((8, 2), int), TypeError, "generator: points must be floats"),
    call=lambda points: tabulate(replicated(points), 8),
)


def test_qmcpys_own_are_sequences():
    qmcpy = pytest.importorskip("qmcpy")
    for made in (qmcpy.DigitalNetB2(3, seed=7), qmcpy.Lattice(3, seed=7), qmcpy.Halton(3, seed=7)):
        points = made.gen_samples(64)
        sequence = tabulate(made, 64)
        assert np.array_equal(sequence.bits(np.arange(64)), np.floor(points * 2**32))


def test_engines_of_scipy_go_on_where_they_are():
    engine = qmc.Halton(2, scramble=False)
    engine.fast_forward(5)
    assert np.allclose(tabulate(engine, 7).points(7), qmc.Halton(2, scramble=False).random(12)[5:])
    assert SequenceEngine(sequences.sobol(2)).random(0).shape == (0, 2)


def test_scipy_takes_our_engine():
    """Normal variates of an Owen-scrambled net have the mean and the covariance that were asked for."""
    engine = SequenceEngine(sequences.owen(sequences.sobol(2), key=3))
    normal = qmc.MultivariateNormalQMC([1.0, -2.0], [[2.0, 0.5], [0.5, 1.0]], engine=engine).random(1024)
    assert np.allclose(normal.mean(axis=0), [1, -2], atol=0.02)
    assert np.allclose(np.cov(normal.T), [[2, 0.5], [0.5, 1]], atol=0.05)
    assert analysis.SequenceEngine is SequenceEngine and analysis.read_points is bridges.read_points


@pytest.mark.parametrize(
    "sequence", [sequences.sobol(2), *tables.slow(sequences.halton(2), sequences.lattice(2))]
)
def test_qmc_quad_takes_an_engine(sequence):
    """Its estimates are independent: errors of exp(x + y) are as its standard errors say, over seeds."""
    exact, ratios = np.expm1(1) * np.expm1(2), []
    for seed in range(12):
        engine = SequenceEngine(sequence, seed=seed)
        found = qmc_quad(lambda x: np.exp(x.sum(axis=0)), [0, 0], [1, 2], n_points=64, qrng=engine)
        assert 1e-6 < found.standard_error < 0.02 * exact
        ratios.append((found.integral - exact) / found.standard_error)
    # Of Student's t with 7 degrees of freedom, of variance 7 / 5 and fourth moment 9.8.
    assert abs(np.mean(np.square(ratios)) - 7 / 5) < 5 * np.sqrt((9.8 - 1.96) / 12)
    again = [SequenceEngine(sequence, seed=3).random(4) for _ in range(2)]
    np.testing.assert_array_equal(*again)
