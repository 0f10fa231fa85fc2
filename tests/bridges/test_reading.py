"""Points of other programs, and ours in theirs."""

import numpy as np
import pytest
from refusals import refused
from scipy.stats import qmc

from analysis import SequenceEngine, read_points, star_discrepancy
from qmcjax import sequences

SOBOL = sequences.sobol(3)


def test_points_come_back_from_files(tmp_path):
    points = np.asarray(SOBOL.points(64, dtype=np.float64))
    np.save(tmp_path / "a.npy", points)
    np.savetxt(tmp_path / "a.txt", points, delimiter=",")
    # UTK separates point sets by "#" and writes digits10 + 2 decimals.
    rows = [
        "\n".join(" ".join(f"{x:.17f}" for x in point) for point in part) for part in (points[:8], points)
    ]
    (tmp_path / "a.dat").write_text("# comment\n" + "\n#\n".join(rows) + "\n\n#\n")
    assert np.array_equal(read_points(tmp_path / "a.npy"), points)
    assert np.array_equal(read_points(str(tmp_path / "a.txt")), points)
    assert np.array_equal(read_points(tmp_path / "a.dat"), points[:8])
    assert np.array_equal(read_points(tmp_path / "a.dat", 1), points)


def test_eight_decimals_give_the_printed_discrepancy(tmp_path):
    """Z paper, Fig. 6(a): 0.000372996695 is that of the points as written to a file."""
    points = np.asarray(sequences.sobol(2).points(2**14, dtype=np.float64))
    np.savetxt(tmp_path / "net.dat", points, fmt="%.8f")
    assert round(star_discrepancy(read_points(tmp_path / "net.dat")), 12) == 0.000372996695


def test_an_engine_draws_the_sequence_block_by_block():
    engine, points = SequenceEngine(SOBOL), np.asarray(SOBOL.points(40, dtype=np.float64))
    assert np.array_equal(
        np.concatenate([engine.random(5), engine.random(11), engine.random(0)]), points[:16]
    )
    assert np.array_equal(engine.fast_forward(4).random(20), points[20:40])
    assert np.array_equal(engine.reset().random(3), points[:3])
    assert engine.d == 3
    assert engine.integers(2, u_bounds=10, n=4).max() < 10


@pytest.mark.parametrize("engine", [qmc.Sobol(3, rng=1), qmc.LatinHypercube(3, rng=1)])
def test_a_sequence_has_the_points_of_an_engine(engine):
    points = engine.random(32)
    sequence = sequences.tabulated(points)
    expected = np.floor(points * 2**32)
    assert np.array_equal(sequence.bits(np.arange(32, dtype=np.uint32)), expected)
    assert np.array_equal(sequence.points(20, 12, dtype=np.float64), expected[12:] / 2**32)
    scrambled = sequences.owen(sequence, key=1).points(32)
    assert scrambled.shape == (32, 3)


def test_the_last_number_below_one_stays_below():
    sequence = sequences.tabulated([[1 - 2.0**-53, 0.0]])
    assert np.array_equal(sequence(0), [1 - 2.0**-24, 0])
    assert sequence.limit == 1


@pytest.mark.parametrize(
    ("text", "which", "message"),
    [
        ("0.5 0.5\n0.5\n", 0, "line 2, column 1, must have 2 coordinates, got 1"),
        ("0.5 x\n", 0, "line 1, column 5, must be a finite number, got 'x'"),
        ("0.5 0.5\n", 1, "which must be below the 1 point sets .* got 1"),
        ("0.5 0.5\n0.5,\n", 0, "line 2, column 1, must have 2 coordinates, got 1"),
        ("0.5\n", -1, "which must be .* got -1"),
    ],
)
def test_bad_files_are_named(tmp_path, text, which, message):
    path = tmp_path / "points.dat"
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_points(path, which)


def after_three():
    """Return an engine that has one of its four points left."""
    engine = SequenceEngine(sequences.hammersley_net(2))
    engine.random(3)
    return engine


test_bad_input_is_named = refused(
    (lambda: SequenceEngine(sequences.hammersley_net(2)).random(5), r"n must be .* \[0, 4\], got 5"),
    (lambda: SequenceEngine(sequences.hammersley_net(2)).fast_forward(5), "n must be .* got 5"),
    (lambda: after_three().fast_forward(2), r"n must be .* \[0, 1\], got 2"),
    (lambda: after_three().fast_forward(1).random(1), r"n must be .* \[0, 0\], got 1"),
    error=ValueError,
)


def test_arrays_of_another_kind_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(4))
    with pytest.raises(ValueError, match="must hold floats"):
        read_points(tmp_path / "a.npy")
