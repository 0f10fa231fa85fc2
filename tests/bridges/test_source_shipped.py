"""Text that others ship: golden vectors find what is wrong with it, and C needs no library."""

import re
import subprocess

import compiled
import numpy as np
import pytest
import shaders
import tables
from test_source import TOOLS, missing

from qmcjax import orders, samplers, scenes, sequences
from qmcjax.bridges import source

VECTORS = 32
OBJECTS = {"sampler": samplers.z(16, 16, 4, key=1), "order": orders.scrambled_morton(16, 16, key=1)}
OBJECTS["sequence"] = sequences.owen(sequences.sobol(2), 1)


SOME_SCENES = {"round": scenes.ball(), "exp": scenes.gaussian(), "sin": scenes.zone_plate()}
SOME_SCENES["floor"] = scenes.checkerboard()


def missed(folder, text, tool, kind, size, inputs=0):
    """Return what a text's own check returns."""
    if missing(tool):
        pytest.skip(missing(tool))
    if tool in compiled.COMPILERS:
        return compiled.library(folder, compiled.driven(text, kind, tool, size, inputs), tool).checked_mine()
    return int(shaders.run(tool, text, "check", [np.zeros(1, np.uint32)], 1, folder)[0, 0])


@pytest.mark.parametrize("tool", tables.few(TOOLS, "gcc", "rust"))
@pytest.mark.parametrize("kind", OBJECTS)
def test_vectors_find_what_is_wrong(kind, tool, tmp_path):
    """One bit of a seed that was pasted wrongly changes many of their results."""
    language = compiled.COMPILERS[tool][0] if tool in compiled.COMPILERS else tool
    text, size = source(OBJECTS[kind], None, language, vectors=VECTORS), 1 if kind == "order" else 2
    seed = re.compile(r"(mine_seeds[^\n]*[{(\[]\n +)(\d+)")
    wrong = type(text)(seed.sub(lambda found: f"{found[1]}{int(found[2]) ^ 1}", text, count=1), text.tables)
    assert missed(tmp_path, text, tool, kind, size) == 0
    (tmp_path / "wrong").mkdir()
    assert missed(tmp_path / "wrong", wrong, tool, kind, size) > VECTORS // 4


def rows(text, width):
    words = re.search(r"mine_vectors\[\d+\] = \{(.*?)\};", text, re.S)[1]
    return np.array([int(word.strip(" \nu")) for word in words.split(",")], np.uint32).reshape(-1, width)


@pytest.mark.parametrize("vectors", [2, 256])
def test_vectors_are_of_the_whole_domain(vectors):
    """The first and the last argument of all, and random ones, with the words of results."""
    sampler = samplers.z(16, 32, 4, key=1)
    found = rows(source(sampler, vectors=vectors), 5)
    assert len(found) == vectors and found[[0, -1], :3].tolist() == [[0, 0, 0], [15, 31, 3]]
    assert np.array_equal(np.asarray(sampler(*found[:, :3].T)).view(np.uint32), found[:, 3:])
    if vectors > 2:
        assert [len(np.unique(column)) for column in found.T[:3]] == [16, 32, 4]
    last = rows(source(samplers.independent(sequences.sobol(2), 1), vectors=2), 5)[-1]
    assert last[:3].tolist() == [2**32 - 1] * 3
    smaller = rows(source(sampler, vectors=2, width=16, height=32, spp=2), 5)
    assert smaller[-1, :3].tolist() == [15, 31, 1]
    assert "vectors" not in source(sampler)


@pytest.mark.parametrize("tool", tables.few([tool for tool in TOOLS if tool != "clang"], "gcc"))
def test_values_of_scenes_are_within_bounds(tool, tmp_path):
    language = compiled.COMPILERS[tool][0] if tool in compiled.COMPILERS else tool
    for number, (name, scene) in enumerate(SOME_SCENES.items()):
        (folder := tmp_path / str(number)).mkdir()
        text = source(scene, language=language, vectors=VECTORS)
        assert missed(folder, text, tool, "scene", 1, len(scene.needs)) == 0, name


OTHERS = ("randomized", "designed", "tiled")
"""Kinds of samplers of an unknown domain, and with square roots."""
TWENTY = [name for name in tables.SAMPLERS if not name.startswith(OTHERS)][:20]
FREE = [*compiled.WARNINGS, "-std=c99", "-pedantic", "-ffreestanding", "-c", "-o", "mine.o", "mine.c"]


@pytest.mark.parametrize("command", ["gcc", "clang", "clang --target=wasm32"])
@pytest.mark.parametrize("names", [TWENTY[:2], *tables.slow(TWENTY)])
def test_c_is_freestanding(names, command, tmp_path):
    """No header of a library, no warning, and WebAssembly, beside texts of all others."""
    if missing(command.split()[0]):
        pytest.skip(missing(command.split()[0]))
    made = [tables.SAMPLERS[title] for title in names]
    texts = [source(sampler, None, name=f"mine{k}", vectors=4) for k, sampler in enumerate(made)]
    assert not [title for title, text in zip(names, texts, strict=True) if "math.h" in text]
    (tmp_path / "mine.c").write_text("\n".join(texts))
    done = subprocess.run([*command.split(), *FREE], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:4000]


def test_passes_need_the_size_of_the_image():
    """They do not say it themselves."""
    passes = tables.SAMPLERS["randomized, contiguous, owen"]
    with pytest.raises(ValueError, match="vectors must be 0 without the size of the image"):
        source(passes, vectors=2)
    found = rows(source(passes, vectors=2, width=32, height=32, spp=4), 5)
    assert found[-1, :3].tolist() == [31, 31, 3]


def test_what_needs_a_library_includes_it():
    assert "#include <math.h>" in source(scenes.gaussian()) and "math.h" not in source(scenes.ball())
