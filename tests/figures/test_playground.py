"""The playground's script: samplers, seeds, exact images, its size, and what is not in it."""

import re

import jax.numpy as jnp
import numpy as np
import playgrounds
import pytest

from figures.page import playground_script
from figures.playground import COUNTS, KEYS, SAMPLERS, SCENES, playground
from qmcjax import samplers, scenes, sequences
from qmcjax.bridges import seeds, source

SIDE = 16


def owen(spp, key):
    return samplers.independent(sequences.sobol(2), key)


def with_numpy(spp, key):
    return samplers.function(lambda x, y, s: jnp.stack([np.sqrt(x.astype(jnp.float32)), y * 0.0], -1), 2)


def of_powers(spp, key):
    return samplers.z(SIDE, SIDE, spp, key)


def with_exact(**given):
    return {name: (scene, scene.reference(SIDE, SIDE)[0]) for name, scene in given.items()}


DISC = with_exact(disc=scenes.disc())


@pytest.mark.slow
def test_ours_has_a_dozen_samplers_and_is_small():
    """A playground adds at most 440 kB to a page; the tile of 16 samples in four dimensions takes 118."""
    made_of = playgrounds.packed()
    data = playgrounds.unpacked(made_of.script)
    assert made_of.left_out == {}
    assert [each["name"] for each in data["samplers"]] == list(SAMPLERS) and len(SAMPLERS) == 12
    assert [each["name"] for each in data["scenes"]] == list(SCENES) and len(SCENES) == 8
    assert (data["counts"], data["keys"]) == (list(COUNTS), list(KEYS))
    assert len(made_of.script) + len(playground_script()) < 440e3
    for each in data["samplers"]:
        assert [len(programs) for programs in each["programs"]] == [len(KEYS)] * len(COUNTS)
        # Keys are parameters: a number of samples has one program.
        assert all(len({text for text, *_ in programs}) == 1 for programs in each["programs"])


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_exact_images_are_rounded_to_24_bits(scene):
    data = playgrounds.unpacked(playgrounds.packed().script)
    stored = next(each for each in data["scenes"] if each["name"] == scene)
    reference, bound = SCENES[scene]().reference(playgrounds.SIDE, playgrounds.SIDE)
    off = np.abs(playgrounds.exact(data, stored) - reference)
    assert off.max() <= 0.5 / (2**24 - 1) * (1 + 1e-6) and np.max(bound) < 1e-8


def test_seeds_of_other_keys_are_those_of_their_own_source():
    texts = [source(of_powers(4, key), language="glsl") for key in (1, 2)]
    tables = [re.search(r"mine_seeds\[\d+\] = uint\[\d+\]\((.*?)\);", text, re.S)[1] for text in texts]
    own = [np.array([int(word.strip(" \nu")) for word in table.split(",")], np.uint32) for table in tables]
    found = seeds(of_powers(4, 1), of_powers(4, 2))
    assert np.array_equal(found, own[1]) and not np.array_equal(found, own[0])
    with pytest.raises(ValueError, match="other must differ from sampler in its seeds only"):
        seeds(of_powers(4, 1), of_powers(16, 1))
    with pytest.raises(ValueError, match="other must differ from sampler in its seeds only"):
        seeds(owen(4, 1), samplers.independent(sequences.lattice(2), 1))
    with pytest.raises(TypeError, match="other must be a sampler"):
        seeds(owen(4, 1), 3)


def test_a_text_is_kept_once_for_all_keys_and_counts_that_share_it():
    made = playground({"Owen": owen, "Z": of_powers}, DISC, SIDE, (1, 4), (1, 2, 3))
    data = playgrounds.unpacked(made.script)
    of_owen, of_z = ([[text for text, *_ in at] for at in each["programs"]] for each in data["samplers"])
    assert of_owen == [[0] * 3] * 2 and of_z == [[1] * 3, [2] * 3] and len(data["texts"]) == 3
    known = [tuple(words) for at in data["samplers"][0]["programs"] for *_, words in at]
    assert known[:3] == known[3:] and len(set(known)) == 3, "seeds are those of keys, whatever the count"


def test_what_cannot_be_translated_is_left_out_in_words():
    worlds = DISC | with_exact(**{"negative": scenes.ramp(0)})
    worlds["negative"] = (worlds["negative"][0], worlds["negative"][1] - 1)
    worlds["colours"] = (scenes.disc(), np.zeros((SIDE, SIDE, 3)))
    found = playground({"mine": with_numpy, "Z": of_powers}, worlds, SIDE, (4, 5), (1,))
    assert found.left_out["colours"] == "its values are colours"
    assert found.left_out["negative"] == "its values are not in [0, 1]"
    assert re.search(r"calls NumPy .*test_playground.py:\d+", found.left_out["mine"])
    data = playgrounds.unpacked(found.script)
    assert [each["name"] for each in data["samplers"]] == ["Z"]
    at_4, at_5 = data["samplers"][0]["programs"]
    assert isinstance(at_4, list) and "spp must be a power of two" in at_5
