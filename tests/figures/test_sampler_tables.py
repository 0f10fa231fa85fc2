"""The page "Which sampler?": what it shows is what the tables say."""

import re

import pytest

import qmcjax as qj
from figures.shared import sampler_errors
from qmcjax.choosing import LEVELS, SETTINGS

CELL = r'<td class="(\w*)" style="[^"]*"><span>([\d.]+)</span> <small>(.*?)</small></td>'


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
                    told = [float(each) for each in (ratio, *interval.split("–"))]
                    assert told == pytest.approx(other[:], rel=0.05, abs=0.006)
    assert next(shown, None) is None
