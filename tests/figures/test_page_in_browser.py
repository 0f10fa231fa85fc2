"""The pages in Debian's chromium, on drafts of figures: ``python -m pytest -m browser -n 0 --drafts=out``.

It has no WebGL here, so that pictures stand in for the playground of the first page.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from figures.catalogue import CATALOGUE
from figures.page import FILES

ROOT = Path(__file__).parents[2]
FIGURES = ("hilbert-1", "spp-slider", "thesis-6.1")
PAGES = [name for name in FILES if name.endswith(".html")]

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def folder(drafts):
    """Bring the drafts up to date that the tests need, and return where the pages are."""
    subprocess.run([sys.executable, "-m", "figures", *FIGURES, "--out", str(drafts)], cwd=ROOT, check=True)
    return drafts


@pytest.fixture
def visit(opened, folder):
    return lambda place="index.html", **options: opened(f"{folder.as_uri()}/{place}", **options)


def rows(page):
    return page.locator("#ledger-table tbody tr:visible")


def verdicts(page):
    return [row.get_attribute("data-verdict") for row in rows(page).all()]


@pytest.mark.parametrize("name", PAGES)
def test_pages_open_fast_read_only_files_that_are_there_and_show_the_focus(visit, name):
    page = visit(name)
    times = "(t => t.loadEventEnd - t.startTime)(performance.getEntriesByType('navigation')[0])"
    assert page.evaluate(times) < 2000
    for image in page.locator("img:visible").all():
        image.scroll_into_view_if_needed()
    page.wait_for_function("[...document.images].every(i => !i.checkVisibility() || i.naturalWidth > 0)")
    alone = "image => image.hidden || image.alt || image.matches('summary img, li > a img')"
    assert page.evaluate(f"[...document.images].every({alone})")
    for _ in range(12):
        page.keyboard.press("Tab")
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert page.evaluate(outline) == "solid", page.evaluate("document.activeElement.outerHTML")[:200]


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [320, 390, 768, 1280, 1400])
def test_a_narrow_screen_scrolls_down_only_and_not_far(visit, width, name):
    """Each tab is on the screen, and nothing is wider than it, folded or not."""
    page = visit(name, viewport={"width": width, "height": 844}, device_scale_factor=2)
    size = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    wide, high = page.evaluate(size)
    assert wide == width and (width == 320 or high <= 15 * 844)
    for tab in page.locator(".top a").all():
        box = tab.bounding_box()
        assert box["x"] >= 0 and box["x"] + box["width"] <= width and box["y"] < 300
    page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
    page.wait_for_timeout(100)
    assert page.evaluate(size)[0] == width


@pytest.mark.parametrize("width", [390, 1400])
def test_each_link_goes_where_it_says(visit, width, folder):
    """Tabs lead to the page of their name, figures to their own, which is then unfolded, counts to claims."""
    page = visit(viewport={"width": width, "height": 844})
    links = "links => links.map(link => [link.getAttribute('href'), link.innerText.trim(), link.className])"
    for place, words, kind in page.locator("a[href]:visible").evaluate_all(links):
        file, _, name = place.partition("#")
        if file.startswith("https://doi.org/"):
            assert words == "doi:" + file.removeprefix("https://doi.org/")
            continue
        page.goto((folder / (file or "index.html")).as_uri() + f"#{name}" * bool(name))
        if file == "docs/index.html":  # where Sphinx has built it
            assert "qmcjax" in page.title()
            continue
        if kind == "" and not name and page.locator(".top [aria-current]").inner_text() == words:
            continue
        if name in CATALOGUE:
            figure = page.locator(f"[id='{name}']")
            figure.locator("> details[open]").wait_for()
            assert words in (name, figure.locator("h3").inner_text()) or name == "spp-slider"
            assert 0 <= figure.locator("h3").bounding_box()["y"] < 844
        else:
            assert page.locator("img" if file.endswith(".png") else "h1").is_visible()


def test_claims_are_filtered_and_sorted(visit):
    page = visit("ledger.html")
    assert set(verdicts(page)[:20]) == {"differs"} and len(verdicts(page)) == 30, "the rest is folded"
    page.get_by_role("button", name="more").click()
    every = verdicts(page)
    assert f"{len(every)} claims" == page.locator("#ledger-shown").inner_text()
    for verdict in dict.fromkeys(every):
        page.locator(f".chip.{verdict}").focus()
        page.keyboard.press("Enter")
        page.wait_for_function("document.querySelector('.chip[aria-current=true]')")
        assert verdicts(page) == [verdict] * every.count(verdict)
        page.locator(f".chip.{verdict}").click()
        page.wait_for_function("!document.querySelector('.chip[aria-current=true]')")
    page.select_option("#ledger-paper", "hilbert")
    page.wait_for_function("location.hash === '#hilbert'")
    places = rows(page).locator("td:first-child").all_inner_texts()
    assert {text.split(",")[0] for text in places} == {"Hilbert"}
    page.fill("#ledger-search", "MOORE fewer")
    assert 0 < rows(page).count() < len(places)
    page.fill("#ledger-search", "")
    head = page.locator("#ledger-table th").first
    for order, known in (("ascending", sorted(places)), ("descending", sorted(places)[::-1])):
        head.get_by_role("button").click()
        assert head.get_attribute("aria-sort") == order
        found = rows(page).locator("td:first-child").all_inner_texts()
        assert sorted(found) == sorted(known) and (found[0], found[-1]) != (places[0], places[-1])


def test_without_scripts_fragments_lead_to_claims(launch, folder):
    """With them, the table is filtered instead, and the page stays at its top."""
    for scripts, shown in ((False, True), (True, False)):
        page = launch(False).new_context(java_script_enabled=scripts).new_page()
        page.goto(f"{folder.as_uri()}/ledger.html#thesis,depends")
        assert (page.locator("h1").bounding_box()["y"] < 0) == shown
        page.close()


def test_the_split_and_the_lens_follow_mouse_and_keys(visit):
    """As much of the left image is shown as lies left of the split; both lenses show the same place."""
    page = visit("thesis.html#thesis-6.1")
    viewer = page.locator("#thesis-6\\.1 .viewer")
    split, left, lenses = viewer.locator(".split"), viewer.locator(".over"), viewer.locator(".magnified")
    split.scroll_into_view_if_needed()
    box = split.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 4, box["y"] + 9)
    assert float(split.input_value()) == pytest.approx(64, abs=2), "of 256 pixels"
    assert left.evaluate("image => image.style.clipPath").startswith("inset(0px 7")
    split.focus()
    page.keyboard.press("Home")
    assert left.evaluate("image => image.style.clipPath") == "inset(0px 100% 0px 0px)"
    assert "jittered grid" in split.get_attribute("aria-valuetext")

    def places():
        return [lens.evaluate("lens => lens.style.backgroundPosition") for lens in lenses.all()]

    viewer.locator(".stage").hover(position={"x": 100, "y": 100})
    first = places()
    lenses.nth(1).focus()
    page.keyboard.press("ArrowRight")
    second = places()
    assert first[0] == first[1] != second[0] == second[1]
    viewer.get_by_role("radio", name="Difference").check(force=True)
    assert "difference" in lenses.first.evaluate("lens => lens.style.backgroundImage")
    viewer.get_by_label("Left of the split").select_option("exact reference")
    assert left.get_attribute("src") == "thesis-6.1.exact-reference.webp"


@pytest.mark.parametrize("place", ["index.html", "ours.html#spp-slider"])
def test_all_samplers_follow_the_slider(visit, place):
    wall = visit(place).locator(".wall[data-name=spp-slider]")
    wall.scroll_into_view_if_needed()
    slider = wall.locator("input.spp")
    slider.focus()
    errors = {}
    for key, spp in (("Home", 1), ("End", 256), ("ArrowLeft", 64)):
        slider.press(key)
        assert wall.locator("output").inner_text() == f"{spp} spp"
        sources = [image.get_attribute("src") for image in wall.locator("img").all()]
        assert all(source.endswith(".filtered.webp") for source in sources[1:])
        assert len(sources) == 4 and all(f"-{spp}-spp" in source for source in sources[1:])
        errors[spp] = [float(text.split()[-1]) for text in wall.locator("figure small").all_inner_texts()[1:]]
    assert all(best < worst for best, worst in zip(errors[256], errors[1], strict=True))
    random, *others = errors[1]
    assert all(1.5 * other <= random for other in others), "the filtered error, as the first page says"


@pytest.mark.parametrize("scale", [1, 1.25, 3])
def test_pictures_fit_and_enlarged_have_whole_pixels_of_the_screen(visit, scale):
    page = visit("thesis.html#thesis-6.1", device_scale_factor=scale)
    link = page.locator("#thesis-6\\.1 .enlarge")
    image, over = link.locator("img"), page.locator("#thesis-6\\.1 .viewer .over")

    def zoom(each):
        each.scroll_into_view_if_needed()
        page.wait_for_function("image => image.naturalWidth > 0", arg=each.element_handle())
        width = "image => image.getBoundingClientRect().width * devicePixelRatio / image.naturalWidth"
        return each.evaluate(width)

    fits = "[...document.querySelectorAll('.enlarge')].every(e => e.scrollWidth <= e.clientWidth)"
    fitting = zoom(image)
    assert page.evaluate(fits)
    link.focus()
    page.keyboard.press("Enter")
    assert zoom(image) == pytest.approx(round(scale), abs=0.01)
    assert image.evaluate("image => getComputedStyle(image).imageRendering") == "pixelated"
    link.click()
    assert zoom(image) == pytest.approx(fitting)
    assert zoom(over) == pytest.approx(round(zoom(over)), abs=0.01) and zoom(over) >= 1


def test_a_picture_can_be_read_on_a_phone(visit):
    """It is wider than the screen, in a box that scrolls; a tap shows all of its pixels."""
    page = visit("hilbert.html#hilbert-1", viewport={"width": 390, "height": 844}, device_scale_factor=2)
    box = page.locator("#hilbert-1 .enlarge")
    width = "box => [box.clientWidth, box.scrollWidth, Number(box.firstElementChild.getAttribute('width'))]"
    inside, whole, pixels = box.evaluate(width)
    assert inside < 390 < min(600, pixels / 2) <= whole
    box.click()
    assert box.evaluate(width)[1] == pixels


def test_claims_and_numbers_of_a_figure_unfold(visit):
    page = visit("thesis.html#thesis-6.1")
    page.locator("#thesis-6\\.1 .claims li").first.wait_for()
    assert not page.locator("#thesis-6\\.2 .claims li").first.is_visible()
    numbers = page.locator("#thesis-6\\.1 .numbers")
    numbers.locator("summary").first.click()
    for name in ("measured", "rms_error"):
        numbers.locator("summary", has_text=name).click()
    numbers.locator("p", has_text="Hammersley").first.wait_for()
    assert "qmcjax thesis-6.1" in numbers.locator(".facts").inner_text()


def test_colours_are_those_of_the_system_until_one_chooses(visit):
    page = visit(color_scheme="dark")
    colour = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(colour)
    page.get_by_role("button", name="Colours").click()
    light = page.evaluate(colour)
    page.reload()
    assert page.evaluate(colour) == light != dark, "the choice is kept"
