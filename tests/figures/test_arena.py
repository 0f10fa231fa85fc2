"""Comparisons from the command line: pages, tables, and what is wrong with a sampler or a command."""

import csv
import json
import re

import numpy as np
import playgrounds
import pytest

from analysis import ComparisonRow
from figures.__main__ import main
from figures.arena._on_mitsuba import at_equal_time
from figures.making import web_images
from figures.shared.mitsuba_runs import mitsuba_scenes
from figures.shared.rivals import RIVALS, SCENES

OWN = """
import jax.numpy as jnp
import numpy as np
from qmcjax import samplers, sequences

def mine(key):
    return samplers.independent(sequences.sobol(4), key)

def nothing():
    return None

def raises():
    return samplers.function(lambda x, y, sample: 1 / 0, 2)

def broken():
    return samplers.function(lambda x, y, sample: jnp.zeros((*x.shape, 2)) + 0.25, 2)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "some_samplers.py").write_text(OWN, encoding="utf-8")
    np.save(tmp_path / "own_points.npy", np.random.default_rng(1).random((16, 2)))
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


SMALL = ["--spp", "1,4", "--size", "32", "--keys", "2", "--against", "owen"]


@pytest.mark.slow
def test_a_page_and_a_table(folder, capsys):
    command = [*"compare some_samplers:mine --points own_points.npy --scenes disc ball".split(), *SMALL]
    assert main(command) == 0
    assert capsys.readouterr().out.split() == ["out/compare/index.html"]
    page = (folder / "out/compare/index.html").read_text(encoding="utf-8")
    assert "mine, own_points, compared" in page and "--size 32" in page
    # Each file that the page names is there.
    named = re.findall(r'(?:src|href)="([^"#][^"]*)"', page)
    named += [
        f"{scene}.{file}"
        for scene in ("disc", "ball")
        for file in re.findall(r'": "([\w.-]+\.(?:png|webp))"', page)
    ][:3]
    assert all((folder / "out/compare" / name).is_file() for name in named if not name.startswith("data:"))
    images = [json.loads(text) for text in re.findall(r'application/json">(.*?)</script>', page)]
    assert [{item["name"] for item in each["items"]} for each in images] == [
        {"reference", "mine", "own_points", "(0,2), Owen"},
        {"reference", "mine", "(0,2), Owen"},
    ]
    assert "it has 2 dimensions, the scene needs 3" in page
    data = playgrounds.unpacked((folder / "out/compare/playground-data.js").read_text())
    assert [(each["name"], each["dims"]) for each in data["samplers"]] == [
        ("mine", 3),
        ("own_points", 2),
        ("(0,2), Owen", 3),
    ]
    assert [each["id"] for each in data["scenes"]] == ["disc", "ball"]
    assert (data["side"], data["counts"], data["keys"]) == (32, [1, 4], [0, 1])
    assert data["start"] == {"left": "mine", "right": "0-2-owen", "spp": 4}
    assert "Not in the playground" not in page
    assert "2 keys: from fewer than 4 there are no intervals, and all ranks are undecided" in page
    with (folder / "out/compare/compare.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * (3 + 2) and {row["sampler"] for row in rows} == {
        "mine",
        "own_points",
        "(0,2), Owen",
    }
    # The same sampler with the same keys, under two names.
    errors = {row["sampler"]: row["RMS error"] for row in rows if (row["scene"], row["spp"]) == ("disc", "4")}
    assert errors["mine"] == errors["(0,2), Owen"] != errors["own_points"]


@pytest.mark.slow
def test_a_broken_sampler_is_told_first(folder, capsys):
    assert main(["compare", "some_samplers:broken", *SMALL, "--scenes", "disc", "--keys", "4"]) == 1
    told = capsys.readouterr().err
    assert "broken breaks 3 of a sampler's promises" in told
    assert "samples 0 and 1 of pixel (0, 0) are the same point" in told
    assert "coordinate 1 is not uniform: it is 0.25 in all points" in told
    page = (folder / "out/compare/index.html").read_text(encoding="utf-8")
    assert page.index("are the same point") < page.index('id="ranks"')
    # It has no key, so that nothing is certain of the two.
    assert "4 keys (1 for broken): samplers with 1 have no interval" in page
    assert page.count("(1–2), ") == 2 * 2 * 3 and page.count("(no interval)") == 1


def test_errors_of_samplers_end_in_a_page(folder, capsys):
    """What raises, and one digit more than two errors share."""
    assert main(["compare", "some_samplers:raises", *SMALL, "--scenes", "disc"]) == 1
    assert "a call with arrays of pixels and samples fails: ZeroDivisionError" in capsys.readouterr().err
    page = (folder / "out/compare/index.html").read_text(encoding="utf-8")
    assert "Left out: raises, since ZeroDivisionError: division by zero." in page
    assert "Not in the playground: raises, since division by zero." in page
    data = playgrounds.unpacked((folder / "out/compare/playground-data.js").read_text())
    assert [each["name"] for each in data["samplers"]] == ["(0,2), Owen"]
    assert data["start"] == {"right": "0-2-owen", "spp": 4}
    with (folder / "out/compare/compare.csv").open(newline="") as file:
        errors = [float(row["RMS error"]) for row in csv.DictReader(file)]
    assert len(errors) == 2 and all(f", {error:.4g}</td>" in page for error in errors)


def test_names_that_differ_only_by_case_or_signs(folder, monkeypatch):
    """Each sampler is compared, by a name whose images have files of their own on any system."""
    (folder / "more.py").write_text(f"{OWN}\nMine = mine\n", encoding="utf-8")
    (folder / "mine").mkdir()
    rng, files = np.random.default_rng(2), ["own_points", "Own-Points", "mine/own_points", "0_2_owen", "MINE"]
    for file in files:
        np.save(folder / f"{file}.npy", rng.random((8, 2)))
    seen = {}

    def compare(named, *given, **options):
        seen.update(named)
        raise KeyboardInterrupt

    monkeypatch.setattr("analysis.compare", compare)
    points = [f"{file}.npy" for file in files]
    with pytest.raises(KeyboardInterrupt):
        main(["compare", "more:mine", "more:Mine", "some_samplers:mine", "--points", *points, *SMALL])
    names = ["mine", "Mine 2", "mine 3", "own_points", "Own-Points 2", "own_points 3", "0_2_owen 2", "MINE 4"]
    assert list(seen) == [*names, "(0,2), Owen"]
    images, _ = web_images.encode({f"{name}, 4 spp": np.zeros((4, 4)) for name in seen})
    assert len({name.lower() for name in images}) == 1 + 3 * len(names)
    first = {name: tuple(np.asarray(seen[name](1)(0, 0, 0)).tolist()) for name in names[3:]}
    assert len(set(first.values())) == 5


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ([], "name a function that makes a sampler"),
        (["some_samplers"], "objects are named module:name, got 'some_samplers'"),
        (["nowhere:mine"], "No module named 'nowhere'"),
        (["some_samplers:yours"], "some_samplers has no 'yours'"),
        (["some_samplers:nothing"], "samplers['nothing'] must be a sampler"),
        (["--points", "nowhere.npy"], "nowhere.npy"),
        (["some_samplers:mine", "--spp", "4,1"], "must be ascending numbers"),
        (["some_samplers:mine", "--size", "16"], "must be at least 32"),
        (["some_samplers:mine", "--keys", "0"], "must be an integer of at least 1"),
        (["some_samplers:mine", "--against", "best"], "invalid choice: 'best'"),
        (["some_samplers:mine", "--scenes", "helicopter", "--size", "96"], "--size must divide 256"),
    ],
)
def test_wrong_usage(folder, capsys, command, message):
    with pytest.raises(SystemExit) as ended:
        main(["compare", *command])
    assert ended.value.code == 2 and message in capsys.readouterr().err
    assert not (folder / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", RIVALS)
def test_rivals_are_samplers_of_any_dimension(name):
    for dims in (2, 5):
        sampler = RIVALS[name].make(dims, 32, 32, 4, 1)
        sampler.check(32, 32, 4)
        assert sampler.dims >= dims or name == "ranked"
        other = RIVALS[name].make(dims, 32, 32, 4, 2)
        assert (sampler(3, 5, 1) != other(3, 5, 1)).any()


def test_scenes_have_references():
    assert all(callable(make().reference) for make in SCENES.values())


def row_of(name, spp, seconds, errors):
    values = {measure: tuple(errors) for measure in ("RMS error", "filtered error")}
    none = np.zeros(0)
    return ComparisonRow("scene", name, spp, values, seconds, none, none, np.zeros((2, 2), np.float32))


def test_errors_at_equal_time():
    """Power laws are exact between and beyond numbers of samples; the first of Mitsuba's keeps its errors."""
    theirs = [row_of("Mitsuba, independent", n, 1.0 * n, [n**-0.5, 3 * n**-0.5]) for n in (1, 4, 16)]
    # Each image takes twice as long, and its error is 1 / n of twice as many.
    ours = [row_of("ours", n, 2.0 * n, [1 / n, 5 / n]) for n in (1, 4, 16)]
    once = [row_of("once", 4, 16.0, [0.5, 0.7])]
    rows = at_equal_time([*ours, *theirs, *once])
    assert [row.values["RMS error"] for row in rows] == [
        row.values["RMS error"] for row in (*ours, *theirs, *once)
    ]
    for row, own in zip(rows[:3], ours, strict=True):
        assert np.allclose(row.values["RMS error at equal time"], 2 * np.array(own.values["RMS error"]))
    for row in rows[3:6]:
        assert np.allclose(row.values["filtered error at equal time"], row.values["filtered error"])
    assert np.allclose(rows[6].values["RMS error at equal time"], [1.0, 1.4])
    assert at_equal_time([*ours, *once]) == [*ours, *once]
    # Nearly fixed times say nothing about errors in half the time: no power of 100.
    fixed = [row_of("fixed", n, 2.0 + 1e-3 * n, [1 / n, 0.0]) for n in (1, 4)]
    rows = at_equal_time([*theirs[:2], *fixed])
    assert np.allclose(rows[2].values["RMS error at equal time"], [2.001**1.5, 0.0])
    slower = [row_of("slower", n, 8.0 / n, [1 / n, 1 / n]) for n in (1, 4)]
    assert at_equal_time([*theirs[:2], *slower])[2].values["RMS error at equal time"] == (0.25, 0.25)


SCENE = """
<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, 1, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="400"/><integer name="height" value="300"/>
            <integer name="crop_width" value="200"/><integer name="crop_offset_x" value="100"/>
        </film>
    </sensor>
    <shape type="sphere"/>
    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
    </shape>
    <emitter type="constant"/>
</scene>
"""


@pytest.mark.skipif(not mitsuba_scenes.installed(), reason="Mitsuba is not installed")
@pytest.mark.slow
def test_scenes_of_mitsuba(folder, capsys):
    """Images of a crop window's aspect; the reference is kept, and taken by the next comparison."""
    (folder / "ball.xml").write_text(SCENE, encoding="utf-8")
    command = "compare some_samplers:mine --mitsuba ball.xml --against independent z stratified".split()
    command += ["--spp", "1,3,4", "--size", "48", "--keys", "4"]
    assert main(command) == 0
    assert capsys.readouterr().out.split() == ["out/compare/index.html"]
    out = folder / "out/compare"
    page = (out / "index.html").read_text(encoding="utf-8")
    assert "32 x 48 pixels" in page and "RMS error at equal time" in page
    assert "Mitsuba, stratified at 3, since spp must be a number that it takes, got 3: it takes 4" in page
    assert "Left out: Z, hash at 3" in page and "Kept by mine." in page
    with (out / "compare.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 + 3 + 2 + 2
    errors = {(row["sampler"], row["spp"]): float(row["RMS error"]) for row in rows}
    assert errors["mine", "4"] < errors["Mitsuba, independent", "4"] < errors["Mitsuba, independent", "1"]
    (kept,) = out.glob("reference-ball-*.npz")
    with np.load(kept) as state:
        assert state["done"] == 16
    # At 4 samples the error of the reference is small beside all others.
    assert float(re.search(r"([\d.]+) of the least one", page)[1]) < 0.5
    before = kept.stat().st_mtime_ns
    assert main([*command[:3], "ball.xml", "--against", "owen", *command[-6:]]) == 0
    assert kept.stat().st_mtime_ns == before and "at equal time" not in (out / "compare.csv").read_text()


@pytest.mark.skipif(not mitsuba_scenes.installed(), reason="Mitsuba is not installed")
@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["--against", "independent"], "independent is a sampler of Mitsuba: name scenes by --mitsuba"),
        (["--mitsuba", "nowhere.xml"], "--mitsuba must name files, got 'nowhere.xml'"),
        (["--mitsuba", "a/x.xml", "b/x.xml"], "--mitsuba must name files of different names"),
    ],
)
def test_wrong_usage_of_mitsuba(folder, capsys, command, message):
    for name in ("a", "b"):
        (folder / name).mkdir()
        (folder / name / "x.xml").write_text(SCENE, encoding="utf-8")
    with pytest.raises(SystemExit) as ended:
        main(["compare", "some_samplers:mine", *command])
    assert ended.value.code == 2 and message in capsys.readouterr().err
    assert not (folder / "out").exists()
