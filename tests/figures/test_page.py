"""The page beside the figures, of numbers that are made up: what is told, escaped, missing or damaged."""

import json
import re
import struct
from html.parser import HTMLParser

import pytest

from figures import page
from figures.catalogue import CATALOGUE, NO_DRAFT, OURS, Entry
from figures.ledger import Claim, _ledger
from figures.page import _write

VOID = {"meta", "link", "img", "input", "br"}
NASTY = "a < b && c > \"d\" 'e' </script><script>alert(1)</script> ${x} $name \u2028"


class Parsed(HTMLParser):
    """The elements of a page, their attributes and texts, and whether all are closed in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements = [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        element = {"tag": tag, "text": "", **dict(attributes)}
        self.elements.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self.open:
            element["text"] += data

    def all(self, tag, part=""):
        """Return the elements of a kind one of whose classes is ``part``, or all of them."""
        return [
            each
            for each in self.elements
            if each["tag"] == tag and (not part or part in (each.get("class") or "").split())
        ]


def entry(**parts):
    machine = {"processor": "Abacus", "cores": 2, "jax": "9.9"}
    numbers = {"measured": {"side": 64, "a": [1, {"b": NASTY}]}, "claims": {}, "note": NASTY} | parts
    head = {"title": "old title", "quality": "draft", "fingerprint": "", "seconds": 1.5, "date": "2020-02-02"}
    return head | {"machine": machine, "numbers": numbers}


def png(path, width=4, height=3):
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", width, height) + b"rest")


TITLES = {
    "z-9": Entry("m", "Noise & <spectra>", our_scene=True),
    "z-2": Entry("m", "Order"),
    "own": Entry("m", "Our own"),
}
CLAIMS = (
    Claim("z", "Fig. 1", "x < y & z", "z-9", "true", measured="<i>{measured[side]}</i>", why="5 > 4"),
    Claim("z", "Fig. 1", "no", "z-9", "false"),
    Claim("z", "Fig. 1", "in parts", "z-9", "cases"),
    Claim("z", "Fig. 2", "not made", "z-2", "true"),
    Claim("thesis", "Sect. 1", "by a test", test="tests/test_a.py::test_b"),
    Claim("thesis", "Sect. 2", "not at all", why="no machine"),
)
FOUND = {"true": True, "false": False, "cases": {"4 spp": True, "<16>": False}}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a folder with one figure that has claims and images, and one without."""
    monkeypatch.setattr(_ledger, "claims", lambda: CLAIMS)
    files = {"file": "i.png", "difference": "d.png", "spectrum": "s.png", "rms": 0.1, "scale": 0.5}
    items = [{"name": "reference", "file": "r.png"}, {"name": NASTY, "spp": 4} | files]
    images = {"width": 4, "height": 3, "transfer": "t", "items": items}
    entries = {"z-9": entry(claims=FOUND) | {"images": images}, "own": entry(table=[{"a": 1}])}
    (tmp_path / "numbers.json").write_text(json.dumps(entries))
    for name in ("z-9", "own", "z-9.r", "z-9.i", "z-9.d", "z-9.s"):
        png(tmp_path / f"{name}.png")
        png(tmp_path / f"{name}.webp")
    return tmp_path


def written(folder, catalogue=TITLES, failed=()):
    page.write(folder, catalogue, failed)
    return (folder / "index.html").read_text(encoding="utf-8")


def test_what_is_in_the_folder_is_shown_and_nothing_of_it_is_markup(folder):
    text = written(folder)
    parsed = Parsed(text)
    assert len(parsed.all("script")) == text.count("<script"), "none that a text brought in"
    assert not [each for each in parsed.all("script") if each["text"] == "alert(1)"]
    assert [each["text"] for each in parsed.all("h3")] == ["Noise & <spectra>", "Our own"]
    assert [each["text"] for each in parsed.all("p", "note")] == [NASTY] * 2
    assert "x < y & z" in [each["text"] for each in parsed.all("td")]
    assert "<i>64</i>" in [each["text"].strip() for each in parsed.all("td")]
    trees = [json.loads(each["text"]) for each in parsed.all("script") if each.get("type")]
    assert {NASTY} == {tree["measured"]["a"][1]["b"] for tree in trees if "measured" in tree}
    assert [tree["items"][1]["name"] for tree in trees if "items" in tree] == [NASTY]
    facts = next(each["text"] for each in parsed.all("dl", "facts"))
    for fact in ("python -m figures z-9", "1.5 s", "Abacus, 2 cores, JAX 9.9", "2020-02-02", "Side64"):
        assert fact in facts
    assert "4 x 3 pixels at 4 samples per pixel" in facts


def test_links_images_and_names_of_places_hold(folder):
    """All lead somewhere, all pictures say in words what they are, and no place has two names."""
    parsed = Parsed(written(folder))
    places = [each["id"] for each in parsed.elements if "id" in each]
    assert len(places) == len(set(places))
    (folder / "own.csv").touch()
    for link in parsed.all("a"):
        target = link["href"]
        inside = target.startswith("#")
        assert target == "#z-2" or (target[1:] in places if inside else (folder / target).is_file()), target
    pictures = parsed.all("img")
    assert [each["alt"] for each in pictures] == [
        "Noise & <spectra>. Claims: 1 reproduced, 1 differs, 1 depends.",
        "Our own. No claims.",
    ]
    assert {(each["width"], each["height"]) for each in pictures} == {("4", "3")}


def test_counts_are_those_of_the_rows(folder):
    parsed = Parsed(written(folder))
    rows = [each["data-verdict"] for each in parsed.all("tr") if "data-verdict" in each]
    assert rows == ["reproduced", "differs", "depends", "by-test", "untested"]
    assert "1 more are of figures that are not in this folder" in parsed.all("section")[1]["text"]
    bar = next(each for each in parsed.all("div", "bar"))["aria-label"]
    assert bar == "1 reproduced, 1 differs, 1 depends, 1 by-test, 1 untested"
    chips = [" ".join(each["text"].split()) for each in parsed.all("button", "chip")]
    assert chips == ["✓ 1 reproduced", "✗ 1 differs", "◐ 1 depends", "☑ 1 by-test", "– 1 untested"]
    cases = [each["text"] for each in parsed.all("span", "case")]
    assert cases == ["✓ 4 spp", "✗ <16>"] * 2, "in the ledger and under the figure"
    shown = next(each for each in parsed.all("code") if "title" in each)
    assert (shown["text"], shown["title"]) == ("test_a.py", "tests/test_a.py::test_b")


def test_what_is_not_there_and_what_stands_in_are_told(folder):
    parsed = Parsed(written(folder, failed=["own"]))
    missing = next(each for each in parsed.all("section") if each.get("id") == "missing")
    assert "1 figure of the papers" in missing["text"] and "python -m figures z-2" in missing["text"]
    badges = [each["text"] for each in parsed.all("span", "badge")]
    assert badges == ["our scene", "draft", "draft", "not up to date"]
    assert "Failed in the last run: own." in [each["text"] for each in parsed.all("p", "warning")]
    assert "The benchmark is not in this folder" in parsed.all("main")[0]["text"]

    (folder / "own.png").unlink()
    (folder / "z-9.d.png").unlink()
    warnings = [each["text"] for each in Parsed(written(folder)).all("p", "warning")]
    assert "own.png is missing." in warnings and "Images are missing: z-9.d.png" in warnings


@pytest.mark.parametrize(
    "damage",
    [
        {},
        {"numbers": None},
        {"numbers": [1]},
        {"quality": "draft", "seconds": "long", "numbers": {}},
        {"quality": "draft", "seconds": 1, "numbers": {"measured": {}, "printed": {"true": True}}},
        {"quality": "draft", "seconds": 1, "numbers": {"claims": {"true": 7, "false": {}, "cases": []}}},
        {"quality": "draft", "seconds": 1, "numbers": {"claims": FOUND}, "images": {"items": [1]}},
        {"quality": "draft", "seconds": 1, "numbers": {"claims": FOUND}, "machine": 3},
    ],
)
def test_old_and_damaged_entries_stop_nothing(folder, damage):
    """The other figure is whole, and claims that cannot be read are left out."""
    entries = json.loads((folder / "numbers.json").read_text())
    (folder / "numbers.json").write_text(json.dumps(entries | {"z-9": damage}))
    parsed = Parsed(written(folder))
    assert [each["id"] for each in parsed.all("article")] == ["z-9", "own"]
    assert len([each for each in parsed.all("tr") if "data-verdict" in each]) == len(CLAIMS) - 4
    assert parsed.all("p", "warning")


@pytest.mark.parametrize("text", [None, "", "[]", '{"z-9": 1}'])
def test_a_folder_without_numbers_has_a_page(folder, text):
    (folder / "numbers.json").unlink()
    if text is not None:
        (folder / "numbers.json").write_text(text)
    assert "3 figures of the papers" in Parsed(written(folder)).all("main")[0]["text"]


def row(scene, sampler, spp, error):
    return {"scene": scene, "sampler": sampler, "spp": spp, "rms error": error}


def test_the_sampler_of_least_error_is_picked_with_its_margin(folder):
    """By class of scenes, as geometric means; within 5 % they are equal."""
    rows = [row("disc", "A", 4, 0.1), row("checkerboard", "A", 4, 0.4), row("disc", "B", 4, 0.1)]
    rows += [row("checkerboard", "B", 4, 0.9), row("disc", "C", 4, 0.01)]
    rows += [row("ball", "A", 4, 0.1), row("ball", "B", 4, 0.104), row("ball", "A, adaptive", 4, 0.1)]
    rows += [row("ball", "C", 4, 0.2), row("new & other", "B", 16, 0.3)]
    catalogue = TITLES | {"benchmark": Entry("m", "Benchmark")}
    (folder / "numbers.json").write_text(json.dumps({"benchmark": entry(table=rows)}))
    parsed = Parsed(written(folder, catalogue))
    table = next(each for each in parsed.elements if each.get("class") == "pick")
    cells = [re.sub(r"\s+", " ", each["text"].partition("ranks")[0]).strip() for each in parsed.all("td")]
    cells = cells[2 * 7 :][:6]  # Behind those of claims that need no figure.
    assert cells == ["A 1.50 × the error: B", "–", "A B 2.00 × the error: C", "–", "–", "B no other measured"]
    assert "New & othernew & other" in table["text"]


def test_what_was_not_made_is_no_failure(folder):
    """The page says which command adds our own figures, and which quality those without a draft."""
    (folder / "numbers.json").write_text("{}")
    parsed = Parsed(written(folder, CATALOGUE))
    assert not parsed.all("p", "warning") and "missing" not in parsed.all("main")[0]["text"]
    papers, ours = CATALOGUE.keys() - OURS, OURS - NO_DRAFT.keys()
    first, *_, of_papers, own, no_draft = [each["text"] for each in parsed.all("p", "lead")]
    assert f"0 of {len(papers)} figures of the papers are here" in first
    assert of_papers.startswith(
        f"{len(papers - NO_DRAFT.keys())} figures of the papers. python -m figures makes"
    )
    assert own == f"{len(ours)} figures of our own. python -m figures --all makes them, too."
    assert no_draft.startswith(f"{len(NO_DRAFT)} figures that a draft would not show. --quality paper makes")
    commands = [each["text"] for each in parsed.all("code")]
    assert "python -m figures benchmark --quality paper" in commands and "python -m figures edges" in commands


def test_a_page_of_all_figures_is_light(folder):
    """One megabyte holds them all, where each has numbers of some kilobytes."""
    numbers = {f"key {k}": k / 7 for k in range(200)}
    (folder / "numbers.json").write_text(json.dumps({name: entry(measured=numbers) for name in CATALOGUE}))
    text = written(folder, CATALOGUE)
    assert len([each for each in Parsed(text).all("article")]) == len(CATALOGUE)
    assert len(text) < 1e6


def test_figures_of_the_tour_and_the_slider_exist():
    assert {step[0] for step in page._tour.STEPS} | {_write.SLIDER} <= CATALOGUE.keys()
