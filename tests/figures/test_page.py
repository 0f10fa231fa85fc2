"""The pages beside the figures, of numbers that are made up: what they say, escape, lack or find damaged."""

import json
import struct
from html.parser import HTMLParser

import pytest

from figures import ledger, page
from figures.catalogue import CATALOGUE, NO_DRAFT, PAPERS, Entry
from figures.ledger import Claim, _ledger
from figures.page import _html, _write

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

    def texts(self, tag, part=""):
        return [each["text"] for each in self.all(tag, part)]

    def all(self, tag, part=""):
        """Return the elements of a kind one of whose classes is ``part``, or all of them."""
        of_tag = [each for each in self.elements if each["tag"] == tag]
        return [each for each in of_tag if not part or part in (each.get("class") or "").split()]


def entry(**parts):
    machine = {"processor": "Abacus", "cores": 2, "jax": "9.9"}
    numbers = {"measured": {"side": 64, "a": [1, {"b": NASTY}]}, "claims": {}, "note": NASTY} | parts
    head = {"title": "old title", "quality": "draft", "fingerprint": "", "seconds": 1.5, "date": "2020-02-02"}
    return head | {"machine": machine, "numbers": numbers}


def png(path, width=4, height=3):
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", width, height) + b"rest")


TITLES = {"z-9": Entry("m", "Noise & <spectra>", our_scene=True)}
TITLES |= {"z-2": Entry("m", "Order"), "own": Entry("m", "Our own")}
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
    assert parsed.texts("h3") == ["Order", "Noise & <spectra>"]
    items = Parsed(numbers(folder)["z-9"]["claims"]).all("li")
    claims = next(each["text"] for each in items if "x < y" in each["text"])
    for part in ("✓ reproduced", "x < y & z", "<i>64</i>", "5 > 4"):
        assert part in claims
    trees = [json.loads(each["text"]) for each in parsed.all("script") if each.get("type")]
    assert [tree["items"][1]["name"] for tree in trees] == [NASTY]
    of = {name: found for name, found in numbers(folder).items() if "note" in found}
    assert {NASTY} == {each["note"] for each in of.values()}
    assert {NASTY} == {each["numbers"]["measured"]["a"][1]["b"] for each in of.values()}
    assert of["z-9"]["facts"] == {
        "Command": "qmcjax z-9", "Quality": "draft", "Time": "1.5 s",
        "Images": "4 x 3 pixels at 4 samples per pixel", "Side": "64",
        "Machine": "Abacus, 2 cores, JAX 9.9", "Made": "2020-02-02",
    }  # fmt: skip
    assert "table" not in of["own"]["numbers"]


def test_links_between_pages_images_and_names_of_places_hold(folder):
    """All lead somewhere, all pictures say in words what they are, and no place has two names."""
    pages = {f"{name}.html": Parsed(written(folder, name)) for name in _html.PAGES}
    (folder / "own.csv").touch()
    places = {file: [each["id"] for each in of.elements if "id" in each] for file, of in pages.items()}
    for file, parsed in pages.items():
        assert len(places[file]) == len(set(places[file]))
        for link in parsed.all("a"):
            target, _, place = link["href"].partition("#")
            target = target or file
            if target in pages:
                assert not place or place in places[target] or link["href"] == _html.href("spp-slider")
            else:
                others = [f"https://doi.org/{paper.doi}" for paper in PAPERS.values()]
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
    assert bar == "1 reproduced, 1 differs, 1 in some cases, 1 by a test, 1 untested"
    chips = [(" ".join(each["text"].split()), each["href"]) for each in parsed.all("a", "chip")]
    signs = {"reproduced": "✓", "differs": "✗", "depends": "◐", "by-test": "☑", "untested": "–"}
    words = {"depends": "in some cases", "by-test": "by a test"}
    assert chips == [(f"{sign} 1 {words.get(of, of)}", f"#{of}") for of, sign in signs.items()]
    cases = parsed.texts("span", "case")
    assert cases == ["✓ 4 spp", "✗ <16>"]
    assert Parsed(numbers(folder)["z-9"]["claims"]).texts("span", "case") == cases
    own = Parsed(numbers(folder)["z-9"]["claims"])
    assert own.texts("summary") == ["The others: ✓ 1 reproduced, ◐ 1 in some cases"]
    assert [each["class"] for each in own.all("b") if "class" in each] == ["differs", "depends", "reproduced"]
    assert "test_b" in parsed.texts("code")

    front = Parsed(written(folder))
    bars = [each["aria-label"] for each in front.all("div", "bar")]
    assert bars == ["no claims", "1 reproduced, 1 differs, 1 in some cases", "1 by a test, 1 untested"]
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
    claims = Parsed(numbers(folder)["z-9"]["claims"]).texts("em")
    assert claims == ["Fig. 1", "Fig. 1; draft contradicts", "Fig. 1; draft too small to tell"]
    small = Parsed(written(folder, "ledger")).texts("small")
    said = ["this draft: contradicts", "this draft: too small to tell"]
    assert [each for each in small if "draft" in each] == said

    assert not page.assess({}).drafts, "without figures the stored verdicts are there"
    assert [each.verdict for each in page.assess({}).findings] == [each.verdict for each in assessed.findings]
    entries["z-9"]["quality"] = "paper"
    own = page.assess(entries)
    assert [each.verdict for each in own.findings[:3]] == ["reproduced", "differs", "depends"]
    assert not own.drafts
    monkeypatch.setattr(ledger, "stored", dict)
    assert Parsed(written(folder, "ledger")).texts("small").count("draft") == 3
    monkeypatch.setattr(ledger, "stored", lambda: {"z-9": {"numbers": {"claims": {"true": 7}}}})
    assert page.assess({}).findings[0].verdict == "missing", "of another version"


def test_what_is_not_there_and_what_stands_in_are_told(folder):
    parsed = Parsed(written(folder, "z", failed=["own"]))
    assert "Not in this folder: qmcjax z-2 makes it." in parsed.all("article")[0]["text"]
    assert parsed.texts("span", "badge") == ["our scene", "draft"]
    ours = Parsed((folder / "ours.html").read_text(encoding="utf-8"))
    assert ours.texts("span", "badge") == ["draft", "not up to date"]
    front = Parsed((folder / "index.html").read_text(encoding="utf-8"))
    assert "Failed in the last run: own." in front.texts("p", "warning")

    (folder / "own.png").unlink()
    (folder / "z-9.d.png").unlink()
    assert Parsed(written(folder, "z")).texts("p", "warning") == ["Images are missing: z-9.d.png"]
    assert "own.png is missing." in Parsed(written(folder, "ours")).texts("p", "warning")


DAMAGED = [
    {"numbers": {"measured": {}, "printed": {"true": True}}},
    {"numbers": {"claims": {"true": 7, "false": {}, "cases": []}}},
    {"numbers": {"claims": FOUND}, "images": {"items": [1]}},
    {"numbers": {"claims": FOUND}, "machine": 3},
    {"numbers": {}, "seconds": "long"},
]
DAMAGED = [{}, {"numbers": None}, *({"quality": "draft", "seconds": 1} | each for each in DAMAGED)]


@pytest.mark.parametrize("damage", DAMAGED)
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


def test_what_was_not_made_is_no_failure(folder):
    """The pages say in order which command makes it, and in which quality if it has no draft."""
    (folder / "numbers.json").write_text("{}")
    papers = [name for name in CATALOGUE if _html.part_of(name) != "ours"]
    assert f"0 of {len(papers)} figures of the papers are here." in written(folder, "index", CATALOGUE)
    for name in _html.PAGES:
        assert not Parsed(written(folder, name, CATALOGUE)).all("p", "warning")
    texts = [written(folder, part, CATALOGUE) for part in _html.PARTS]
    names = [each["id"] for text in texts for each in Parsed(text).all("article")]
    assert sorted(names) == sorted(CATALOGUE)
    for some in ("z-1 z-12 z-table-1", "thesis-3.9 thesis-3.11 thesis-4.1 thesis-table-4.1 thesis-5.2"):
        assert [name for name in names if name in some.split()] == some.split()
    assert {step[0] for step in _write.STEPS} | {_write.SLIDER, _write.HERO} <= CATALOGUE.keys()
    for name in CATALOGUE:
        why = f" --quality paper</code> makes it; a draft would not show it: {NO_DRAFT.get(name)}."
        told = f"qmcjax {name}" + (why if name in NO_DRAFT else "</code> makes it.")
        assert sum(told in text for text in texts) == 1


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


def test_what_a_visitor_copies_runs(folder):
    """In the order in which it stands on the front page and on that for samplers."""
    names = {}
    for name in ("index", "sampler"):
        parsed = Parsed(written(folder, name))
        for code in parsed.texts("pre"):
            if not code.startswith(("qmcjax ", "python -m ")):
                exec(code, names)
    assert names["image"].shape == (64, 64)


def test_what_was_measured_and_the_documentation_are_there_or_what_makes_them_is_named(folder):
    assert "qmcjax spp-slider makes it." in Parsed(written(folder, "which")).all("section")[0]["text"]
    (folder / "spp-slider.which.html").write_text("<p>Take <b>this one</b>.</p>")
    assert Parsed(written(folder, "which")).texts("b") == ["qmcjax", "this one"]
    assert "It is not built in this folder." in written(folder, "documentation")
    (folder / "docs").mkdir()
    (folder / "docs" / "index.html").touch()
    for name in ("index", "documentation"):
        assert 'href="docs/index.html"' in written(folder, name)


def test_the_first_screen_says_what_filtering_does(folder):
    """By the images' own numbers; nothing where they have none."""
    given = [(name, error, spp) for name, error in (("random", 0.4), ("Z", 0.2)) for spp in (1, 4)]
    item = {"file": "i.png", "rms": 0.5}
    items = [{**item, "name": name, "spp": spp, "filtered_rms": error / spp} for name, error, spp in given]
    for each, told in ((items, ["2.00 times"]), (items[:2], [])):
        images = {"width": 4, "height": 3, "transfer": "t", "items": [{"name": "r", "file": "r.png"}, *each]}
        (folder / "numbers.json").write_text(json.dumps({"spp-slider": entry() | {"images": images}}))
        front = written(folder, "index", {"spp-slider": Entry("m", "Slider")})
        assert [text for text in Parsed(front).texts("b") if "times" in text] == told
