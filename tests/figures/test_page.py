"""The pages beside the figures, of numbers that are made up: what they say, escape, lack or find damaged."""

import itertools
import json
import re
import struct
from html.parser import HTMLParser
from pathlib import Path

import pytest

from figures import ledger, page
from figures.catalogue import CATALOGUE, NO_DRAFT, PAPERS, Entry
from figures.ledger import Claim, _ledger
from figures.page import _html, _write
from figures.page._ledger import VERDICTS

ROOT = Path(__file__).parents[2]
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
        self.end({"td": ("td",), "tr": ("td", "tr")}.get(tag, ()))
        element = {"tag": tag, "text": "", **dict(attributes)}
        self.elements.append(element)
        if tag not in VOID:
            self.open.append(element)

    def handle_endtag(self, tag):
        if tag == "tbody":  # In HTML it ends the last row and its last cell.
            self.end(("td", "tr"))
        assert self.open.pop()["tag"] == tag

    def end(self, tags):
        """End open elements whose end tags HTML leaves out."""
        while self.open and self.open[-1]["tag"] in tags:
            self.open.pop()

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
    monkeypatch.setattr(ledger, "stored", dict)
    files = {"file": "i.png", "difference": "d.png", "spectrum": "s.png", "rms": 0.1, "scale": 0.5}
    items = [{"name": "reference", "file": "r.png"}, {"name": NASTY, "spp": 4} | files]
    images = {"width": 4, "height": 3, "transfer": "t", "items": items}
    entries = {"z-9": entry(claims=FOUND) | {"images": images}, "own": entry(table=[{"a": 1}])}
    (tmp_path / "numbers.json").write_text(json.dumps(entries))
    for name in ("z-9", "own", "z-9.r", "z-9.i", "z-9.d", "z-9.s"):
        png(tmp_path / f"{name}.png")
        png(tmp_path / f"{name}.webp")
    return tmp_path


def written(folder, name="index", catalogue=TITLES, failed=()):
    page.write(folder, catalogue, failed)
    return (folder / f"{name}.html").read_text(encoding="utf-8")


def numbers(folder):
    """Return what the script has that a page loads when numbers are unfolded."""
    text = (folder / "page-numbers.js").read_text(encoding="utf-8")
    return json.loads(text.removeprefix("window.figureNumbers = ").removesuffix(";\n"))


def test_what_is_in_the_folder_is_shown_and_nothing_of_it_is_markup(folder):
    text = written(folder, "z")
    parsed = Parsed(text)
    assert len(parsed.all("script")) == text.count("<script") == 2, "none that a text brought in"
    assert [each["text"] for each in parsed.all("h3")] == ["Order", "Noise & <spectra>"]
    items = Parsed(numbers(folder)["z-9"]["claims"]).all("li")
    claims = next(each["text"] for each in items if "x < y" in each["text"])
    for part in ("✓ reproduced", "x < y & z", "<i>64</i>", "5 > 4"):
        assert part in claims
    trees = [json.loads(each["text"]) for each in parsed.all("script") if each.get("type")]
    assert [tree["items"][1]["name"] for tree in trees] == [NASTY]
    of = {name: found for name, found in numbers(folder).items() if "note" in found}
    assert (
        {NASTY}
        == {of[name]["note"] for name in of}
        == {of[name]["numbers"]["measured"]["a"][1]["b"] for name in of}
    )
    assert of["z-9"]["facts"] == {
        "Command": "qmcjax z-9",
        "Quality": "draft",
        "Time": "1.5 s",
        "Images": "4 x 3 pixels at 4 samples per pixel",
        "Side": "64",
        "Machine": "Abacus, 2 cores, JAX 9.9",
        "Made": "2020-02-02",
    }
    assert "table" not in of["own"]["numbers"]


def test_links_between_pages_images_and_names_of_places_hold(folder):
    """All lead somewhere, all pictures say in words what they are, and no place has two names."""
    pages = {f"{name}.html": Parsed(written(folder, name)) for name in _html.PAGES}
    (folder / "own.csv").touch()
    places = {
        file: [each["id"] for each in parsed.elements if "id" in each] for file, parsed in pages.items()
    }
    for file, parsed in pages.items():
        assert len(places[file]) == len(set(places[file]))
        for link in parsed.all("a"):
            target, _, place = link["href"].partition("#")
            target = target or file
            if target == "ledger.html" and place != "questions":
                assert set(place.split(",")) <= {"", "top", *VERDICTS, *ledger.PAPERS}, link["href"]
            elif target in pages:
                assert not place or place in places[target] or link["href"] == _html.href("spp-slider")
            else:
                others = ("docs/index.html", *(f"https://doi.org/{paper.doi}" for paper in PAPERS.values()))
                assert (folder / target).is_file() or target in others, link["href"]
        assert {f"{name}.html" for name in _html.PAGES} <= {link["href"] for link in parsed.all("a")}
    images = [each for parsed in pages.values() for each in parsed.all("img")]
    pictures = [each for each in images if each.get("class") != "thumbnail"]
    assert [each["alt"] for each in pictures] == ["Noise & <spectra>", "Our own"]
    assert len(images) - len(pictures) == 4, "of each, on the front page and on its own"
    assert {(each["width"], each["height"]) for each in pictures} == {("4", "3")}


def test_counts_are_those_of_the_rows(folder):
    """What differs comes first; each count is a link to those claims."""
    parsed = Parsed(written(folder, "ledger"))
    rows = [each["data-verdict"] for each in parsed.all("tr") if "data-verdict" in each]
    assert rows == ["differs", "reproduced", "depends", "by-test", "untested"]
    assert "1 more are of figures that are not in this folder" in parsed.all("section")[0]["text"]
    bar = next(each for each in parsed.all("div", "bar"))["aria-label"]
    assert bar == "1 reproduced, 1 differs, 1 depends, 1 by-test, 1 untested"
    chips = [(" ".join(each["text"].split()), each["href"]) for each in parsed.all("a", "chip")]
    signs = {"reproduced": "✓", "differs": "✗", "depends": "◐", "by-test": "☑", "untested": "–"}
    assert chips == [(f"{sign} 1 {verdict}", f"#{verdict}") for verdict, sign in signs.items()]
    cases = [each["text"] for each in parsed.all("span", "case")]
    assert cases == ["✓ 4 spp", "✗ <16>"]
    assert [each["text"] for each in Parsed(numbers(folder)["z-9"]["claims"]).all("span", "case")] == cases
    own = Parsed(numbers(folder)["z-9"]["claims"])
    assert [each["text"] for each in own.all("summary")] == ["The others: ✓ 1 reproduced, ◐ 1 depends"]
    assert [each["class"] for each in own.all("b") if "class" in each] == ["differs", "depends", "reproduced"]
    assert "test_b" in [each["text"] for each in parsed.all("code")]

    front = Parsed(written(folder))
    bars = [each["aria-label"] for each in front.all("div", "bar")]
    assert bars == ["no claims", "1 reproduced, 1 differs, 1 depends", "1 by-test, 1 untested"]
    counts = {each["href"]: each["text"] for each in front.all("a", "verdict")}
    assert counts["ledger.html#z,differs"] == "✗ 1 differs" and len(counts) == 5


STORED = {"z-9": {"numbers": {"measured": {"side": 256}, "claims": FOUND | {"false": True, "cases": True}}}}


def test_verdicts_are_of_paper_quality_and_drafts_say_whether_they_agree(folder, monkeypatch):
    monkeypatch.setattr(ledger, "stored", lambda: STORED)
    entries = json.loads((folder / "numbers.json").read_text())
    assessed = page.assess(entries)
    assert [each.verdict for each in assessed.findings[:4]] == ["reproduced"] * 3 + ["missing"]
    assert assessed.findings[0].measured == "<i>256</i>"
    drafts = {"true": "agrees", "false": "contradicts", "cases": "too small to tell"}
    assert assessed.drafts == {("z-9", key): said for key, said in drafts.items()}
    written(folder)
    claims = [each["text"] for each in Parsed(numbers(folder)["z-9"]["claims"]).all("em")]
    assert claims == ["Fig. 1", "Fig. 1; draft contradicts", "Fig. 1; draft too small to tell"]
    small = [each["text"] for each in Parsed(written(folder, "ledger")).all("small")]
    assert [each for each in small if "draft" in each] == [
        "this draft: contradicts",
        "this draft: too small to tell",
    ]

    assert not page.assess({}).drafts, "without figures the stored verdicts are there"
    assert [each.verdict for each in page.assess({}).findings] == [each.verdict for each in assessed.findings]
    entries["z-9"]["quality"] = "paper"
    own = page.assess(entries)
    assert [each.verdict for each in own.findings[:3]] == ["reproduced", "differs", "depends"]
    assert not own.drafts
    monkeypatch.setattr(ledger, "stored", dict)
    assert [each["text"] for each in Parsed(written(folder, "ledger")).all("small")].count("draft") == 3
    monkeypatch.setattr(ledger, "stored", lambda: {"z-9": {"numbers": {"claims": {"true": 7}}}})
    assert page.assess({}).findings[0].verdict == "missing", "of another version"


def test_figures_are_in_the_order_of_their_numbers(folder):
    for part, some in (
        ("z", ["z-1", "z-12", "z-table-1"]),
        (
            "thesis",
            ["thesis-3.9", "thesis-3.11", "thesis-4.1", "thesis-table-4.1", "thesis-5.2", "thesis-5.11"],
        ),
    ):
        names = [each["id"] for each in Parsed(written(folder, part, CATALOGUE)).all("article")]
        assert sorted(names) == sorted(name for name in CATALOGUE if name.startswith(f"{part}-"))
        assert [name for name in names if name in some] == some


def test_what_is_not_there_and_what_stands_in_are_told(folder):
    parsed = Parsed(written(folder, "z", failed=["own"]))
    assert "Not in this folder: qmcjax z-2 makes it." in parsed.all("article")[0]["text"]
    assert [each["text"] for each in parsed.all("span", "badge")] == ["our scene", "draft"]
    ours = Parsed((folder / "ours.html").read_text(encoding="utf-8"))
    assert [each["text"] for each in ours.all("span", "badge")] == ["draft", "not up to date"]
    front = Parsed((folder / "index.html").read_text(encoding="utf-8"))
    assert "Failed in the last run: own." in [each["text"] for each in front.all("p", "warning")]

    (folder / "own.png").unlink()
    (folder / "z-9.d.png").unlink()
    assert [each["text"] for each in Parsed(written(folder, "z")).all("p", "warning")] == [
        "Images are missing: z-9.d.png"
    ]
    assert "own.png is missing." in [
        each["text"] for each in Parsed(written(folder, "ours")).all("p", "warning")
    ]


@pytest.mark.parametrize(
    "damage",
    [
        {},
        {"numbers": None},
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
    parsed = Parsed(written(folder, "z"))
    assert [each["id"] for each in parsed.all("article")] == ["z-2", "z-9"]
    assert parsed.all("p", "warning") or Parsed(written(folder)).all("p", "warning")
    rows = [each for each in Parsed(written(folder, "ledger")).all("tr") if "data-verdict" in each]
    assert len(rows) == len(CLAIMS) - 4
    assert "Our own" in written(folder, "ours") and "own" in numbers(folder)


@pytest.mark.parametrize("text", [None, "", "[]", '{"z-9": 1}'])
def test_a_folder_without_numbers_has_a_page(folder, text):
    (folder / "numbers.json").unlink()
    if text is not None:
        (folder / "numbers.json").write_text(text)
    assert "0 of 2 figures of the papers are here" in Parsed(written(folder)).all("main")[0]["text"]


def test_which_sampler_has_what_was_measured_or_says_what_measures_it(folder):
    assert "qmcjax spp-slider makes it." in Parsed(written(folder, "which")).all("section")[0]["text"]
    (folder / "spp-slider.which.html").write_text("<p>Take <b>this one</b>.</p>")
    assert [each["text"] for each in Parsed(written(folder, "which")).all("b")] == ["qmcjax", "this one"]


def test_papers_are_cited_as_in_the_citation_file(folder):
    """Authors, title, year and DOI, on the front page and on that of the paper."""
    file = (ROOT / "CITATION.cff").read_text(encoding="utf-8").partition("references:")[2]
    names = re.findall("family-names: (.*?),", file)
    lines = re.findall(r"^    (title|year|doi): (.*)$", file, re.M)
    cited = {name: Parsed(written(folder, name)).all("p", "citation") for name in ("index", *PAPERS)}
    assert [each["text"] for each in cited["index"]] == [cited[name][0]["text"] for name in PAPERS]
    text = " ".join(each["text"] for each in cited["index"]).lower()
    assert len(names) == 6 and len(lines) == 8
    for word in (*names, *(value for _, value in lines)):
        assert word.lower() in text
    links = [each["href"] for each in Parsed(written(folder)).all("a") if "doi.org" in each["href"]]
    assert links == [f"https://doi.org/{value}" for key, value in lines if key == "doi"]


def test_what_was_not_made_is_no_failure(folder):
    """The pages say which command makes it, and in which quality if it has no draft."""
    (folder / "numbers.json").write_text("{}")
    papers = [name for name in CATALOGUE if _html.part_of(name) != "ours"]
    assert f"0 of {len(papers)} figures of the papers are here." in written(folder, "index", CATALOGUE)
    for name in _html.PAGES:
        assert not Parsed(written(folder, name, CATALOGUE)).all("p", "warning")
    texts = [written(folder, part, CATALOGUE) for part in _html.PARTS]
    for name in CATALOGUE:
        why = f" --quality paper</code> makes it; a draft would not show it: {NO_DRAFT.get(name)}."
        told = f"qmcjax {name}" + (why if name in NO_DRAFT else "</code> makes it.")
        assert sum(told in text for text in texts) == 1


def test_pages_of_all_figures_are_light(folder, monkeypatch):
    """Each is below 150 kB of HTML, with all claims and a fifth of their verdicts for the worse."""
    monkeypatch.undo()
    others = itertools.cycle(["differs", "undecided", "depends", *["reproduced"] * 7])
    found = [
        ledger.Finding(claim, "by-test" if claim.test else next(others), claim.measured or "", {}, "")
        for claim in ledger.claims()
    ]
    monkeypatch.setattr(ledger, "findings", lambda entries: found)
    measured = {f"key {k}": k / 7 for k in range(200)}
    (folder / "numbers.json").write_text(json.dumps({name: entry(measured=measured) for name in CATALOGUE}))
    for name in CATALOGUE:
        png(folder / f"{name}.png")
        png(folder / f"{name}.webp")
    articles = sum(len(Parsed(written(folder, part, CATALOGUE)).all("article")) for part in _html.PARTS)
    assert articles == len(CATALOGUE)
    sizes = {name: (folder / f"{name}.html").stat().st_size for name in _html.PAGES}
    assert max(sizes.values()) < 150e3, sizes


def test_a_moving_picture_is_still_until_it_is_opened(folder):
    """An animation in closed details loads and plays once a reader opens them, and stops when they close."""
    entries = json.loads((folder / "numbers.json").read_text())
    entries["own"]["files"] = ["frames.webp"]
    (folder / "numbers.json").write_text(json.dumps(entries))
    assert "own.frames.webp is missing." in written(folder, "ours")
    png(folder / "own.frames.webp")
    parsed = Parsed(written(folder, "ours"))
    assert [each.get("open") for each in parsed.all("details", "moving")] == [None]
    (image,) = [each for each in parsed.all("img") if each["src"] == "own.frames.webp"]
    assert (image["loading"], image["alt"]) == ("lazy", "Our own: raw frames and moving averages")


def test_figures_of_the_tour_and_the_slider_exist():
    assert {step[0] for step in _write.STEPS} | {_write.SLIDER, _write.HERO} <= CATALOGUE.keys()


def test_what_a_visitor_copies_runs(folder):
    """In the order in which it stands on the front page and on that for samplers."""
    names = {}
    for name in ("index", "sampler"):
        parsed = Parsed(written(folder, name))
        for code in [each["text"] for each in parsed.all("pre")]:
            if not code.startswith(("qmcjax ", "python -m ")):
                exec(code, names)
    assert names["image"].shape == (64, 64)
