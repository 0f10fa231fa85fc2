"""The page "Which sampler?": what it shows is what the tables say."""

import re

import numpy as np
import pytest

import qmcjax as qj
from figures.shared import sampler_errors
from qmcjax.choosing import CANDIDATES, LEVELS, SETTINGS, worst_cases

sampler_tables = pytest.importorskip("figures.docs.sampler_tables", reason="Sphinx", exc_type=ImportError)


@pytest.mark.parametrize("filtered", [False, True])
@pytest.mark.parametrize("setting", SETTINGS)
def test_tables_show_what_is_recommended(setting, filtered):
    """The best of each column, ratios with their intervals, and in bold what is significantly worse."""
    tables = [sampler_errors._table(SETTINGS[setting], level, filtered) for level in LEVELS]
    assert all(each in sampler_errors.which_sampler() for each in tables)
    rows = re.findall(r'<tr><th scope="row">(.*?)</th>(.*?)</tr>', "".join(tables), re.S)
    shown = iter([(name.replace("&#x27;", "'"), re.findall(CELL, cells)) for name, cells in rows])
    arguments = {"images": {}, "frames": {"frames": 32}, "prefixes": {"progressive": True}}[setting]
    for level in LEVELS:
        columns = [
            qj.recommend(level, spp, smooth, filtered=filtered, **arguments)
            for smooth in (False, True)
            for spp in SETTINGS[setting].spps
        ]
        for name, cells in (next(shown) for _ in range(1 + len(columns[0].others))):
            for (classes, ratio, interval), choice in zip(cells, columns, strict=True):
                other = choice.others.get(name)
                assert (classes == "best") == (name == choice.name) == (interval == "")
                if other:
                    assert (classes == "differs") == other.differs
                    assert [float(each) for each in (ratio, *interval.split("–"))] == pytest.approx(
                        other[:], rel=0.05, abs=0.006
                    )
    assert next(shown, None) is None


CELL = r'<td class="(\w*)" style="[^"]*"><span>([\d.]+)</span> <small>(.*?)</small></td>'


def test_the_safest_has_the_least_worst_case():
    name, (ratio, where) = next(iter(worst_cases(True).items()))
    said = sampler_errors.safest_sampler("images", True)
    assert f"{ratio:.2f}" in said and where in said and name.partition("'")[0] in said


def test_the_smallest_is_the_best_of_the_small():
    name, ratio, size = sampler_tables.smallest(4, 4, True)
    choice = qj.recommend(4, 4, filtered=True)
    assert size == sampler_tables.table_bytes(name, 4, 4) <= sampler_tables.SMALL
    better = [choice.name, *choice.others]
    better = better[: better.index(name)]
    assert all(sampler_tables.table_bytes(other, 4, 4) > sampler_tables.SMALL for other in better)
    assert ratio == (choice.others[name].ratio if better else 1.0)


def test_bytes_are_those_of_arrays():
    sampler = CANDIDATES["designed tiles"].make(2, 128, 128, 4, 1)
    assert sampler_tables.table_bytes("designed tiles", 2, 4) >= np.asarray(sampler.tile).nbytes
    assert sampler_tables.table_bytes("random", 2, 4) < 64
