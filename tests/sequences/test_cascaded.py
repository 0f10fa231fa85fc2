"""Cascaded nets: every two neighbouring dimensions are a (0,m,2)-net."""

import numpy as np
import pytest
from tables import first, is_net

import analysis
from analysis.tables import sobol_components
from qmcjax import sequences


@pytest.mark.parametrize("m", [1, 2, 7, 10])
def test_neighbouring_dimensions_are_nets(m):
    words = np.asarray(sequences.cascaded_net(m, 32).bits(first(2**m)))
    assert all(is_net(words[:, k : k + 2], m) for k in range(31))
    assert np.array_equal(words[:, 0], first(2**m) << (32 - m))


@pytest.mark.parametrize("m", [17, 31, 32])
def test_neighbouring_dimensions_of_large_nets(m):
    """By ranks of matrices."""
    matrices = np.asarray(sequences.cascaded_net(m, 32).matrices)
    assert all(analysis.t_value(matrices[k : k + 2], m=m) == 0 for k in range(0, 31, 5))


def test_each_dimension_is_a_component_whose_index_is_the_one_before():
    m = 9
    words = np.asarray(sequences.cascaded_net(m, 6).bits(first(2**m)))
    sobol = np.asarray(sequences.sobol(61).bits(first(2**m)))
    for k in range(5):
        index = words[:, k] >> (32 - m)
        assert sum(np.array_equal(words[:, k + 1], sobol[index, j]) for j in range(1, 61)) == 1


def test_fewer_dimensions_are_the_first_and_scramblings_keep_the_nets():
    small, large = sequences.cascaded_net(8, 3), sequences.cascaded_net(8, 32)
    assert np.array_equal(small.points(256), large.points(256)[:, :3])
    words = np.asarray(sequences.owen(small, 1).bits(first(256)))
    assert is_net(words[:, :2], 8)
    assert is_net(words[:, 1:], 8)


def test_no_dimension_comes_again_and_others_are_near_nets():
    """What the components are chosen for; the same one all the way would come again."""
    for m in (8, 12, 15):
        t = analysis.projection_t_values(sequences.cascaded_net(m, 32).matrices, m=m)
        assert max(t.values()) < m - 1
        assert np.mean(list(t.values())) < 3.5
    pascal = np.asarray(sequences.sobol(2).matrices)[1]
    columns = [np.uint32(1) << np.arange(32 - 10, 32, dtype=np.uint32)]
    for _ in range(3):
        columns.append(sobol_components.following(columns[-1], 10, pascal))
    assert np.array_equal(columns[0], columns[3])


def test_there_are_no_frames():
    with pytest.raises(ValueError, match="net must be invertible"):
        sequences.cascaded_net(4, 2).inverted(2)
