"""The page "Which sampler?": what it says is what the tables say."""

import numpy as np
import pytest

import qmcjax as qj
from qmcjax.choosing import CANDIDATES, LEVELS, SETTINGS

sampler_tables = pytest.importorskip("figures.docs.sampler_tables", reason="Sphinx", exc_type=ImportError)

PAGE = sampler_tables.__file__.replace("sampler_tables.py", "which_sampler.rst")


def test_all_settings_are_on_the_page():
    with open(PAGE, encoding="utf-8") as stream:
        text = stream.read()
    assert set(sampler_tables.ARGUMENTS) == set(SETTINGS)
    assert all(f".. best-samplers:: {setting}\n" in text for setting in SETTINGS)


def test_no_sampler_is_typed_on_the_page():
    """Names come from the measurements only."""
    with open(PAGE, encoding="utf-8") as stream:
        text = stream.read()
    names = {name for setting in SETTINGS.values() for name in setting.candidates}
    assert not [name for name in names if name in text]


@pytest.mark.parametrize("setting", SETTINGS)
def test_sentences_name_the_best_at_each_number_of_samples(setting):
    found = sampler_tables.sentences(setting)
    assert len(found) == len(LEVELS)
    for level, sentence in zip(LEVELS, found, strict=True):
        for filtered, part in enumerate(sentence.split(" error: ")[1:]):
            for spp in SETTINGS[setting].spps:
                choice = sampler_tables.choice(setting, level, spp, None, bool(filtered))
                assert (f"“{choice.name}”" in part) or choice.margin is None


def test_cells_say_what_is_recommended():
    certain, alike, none = qj.recommend(2, 16, True), qj.recommend(4, 4, True), qj.recommend(4, 1, False)
    assert sampler_tables.cell(certain) == f"“{certain.name}”\nnext {certain.margin.ratio:.2f}"
    assert f"or {len(alike.alternatives)} others; next" in sampler_tables.cell(alike)
    assert sampler_tables.cell(none) == "no certain difference"


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
