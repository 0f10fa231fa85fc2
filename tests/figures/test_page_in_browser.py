"""The pages in Debian's chromium, on drafts of figures: ``python -m pytest -m browser -n 0 --drafts=out``.

It has no WebGL here, so that pictures stand in for the playground of the first page.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from webgl import GRAPHICS, NO_GRAPHICS

from figures.page import FILES

ROOT = Path(__file__).parents[2]
FIGURES = ("hilbert-1", "spp-slider", "thesis-6.1")
OPTIONS = """--no-sandbox --disable-quic --no-first-run --disable-background-networking
    --disable-component-update --disable-sync"""

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def address(pytestconfig):
    """Bring the drafts up to date that the tests need, and return where the pages are."""
    given = pytestconfig.getoption("--drafts")
    folder = Path(given).resolve() if given else pytestconfig.cache.mkdir("figures")
    subprocess.run([sys.executable, "-m", "figures", *FIGURES, "--out", str(folder)], cwd=ROOT, check=True)
    return folder


@pytest.fixture(scope="module")
def launch():
    """Return what starts a browser with some options."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = []

        def launch(more):
            options = [*OPTIONS.split(), *more]
            started.append(playwright.chromium.launch(executable_path="/usr/bin/chromium", args=options))
            return started[-1]

        yield launch
        for browser in started:
            browser.close()


@pytest.fixture(scope="module")
def browser(launch):
    return launch(NO_GRAPHICS)


@pytest.fixture
def visit(browser, address):
    """Return what opens a page; in the end, nothing may have been wrong with it."""
    opened, wrong = [], []

    def failed(request):
        if request.failure != "net::ERR_ABORTED":  # The slider moved on before an image was read.
            wrong.append(request.url)

    def visit(place="index.html", **options):
        page = browser.new_page(**({"viewport": {"width": 1400, "height": 1000}} | options))
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("requestfailed", failed)
        page.on(
            "request",
            lambda request: (
                None if request.url.startswith(("file:", "data:", "blob:")) else wrong.append(request.url)
            ),
        )
        page.goto(f"{address.as_uri()}/{place}")
        opened.append(page)
        return page

    yield visit
    for page in opened:
        page.close()
    assert wrong == []


PAGES = [name for name in FILES if name.endswith(".html")]


def rows(page):
    return page.locator("#ledger-table tbody tr:visible")


@pytest.mark.parametrize("name", PAGES)
def test_pages_open_fast_and_read_only_files_that_are_there(visit, name):
    page = visit(name)
    times = "(t => t.loadEventEnd - t.startTime)(performance.getEntriesByType('navigation')[0])"
    assert page.evaluate(times) < 2000
    for image in page.locator("img:visible").all():
        image.scroll_into_view_if_needed()
    page.wait_for_function("[...document.images].every(image => image.hidden || image.naturalWidth > 0)")
    assert page.evaluate("[...document.images].every(image => image.hidden || image.alt)")


def test_they_weigh_less_than_40_megabytes(address):
    files = [*(address / name for name in FILES), *address.glob("*.webp")]
    assert sum(file.stat().st_size for file in files) < 40e6
    assert max((address / name).stat().st_size for name in PAGES) < 150e3


def test_the_first_page_has_twelve_screens_and_begins_with_the_slider(visit):
    page = visit(viewport={"width": 1400, "height": 900})
    for image in page.locator("img").all():
        image.scroll_into_view_if_needed()
    assert page.evaluate("document.documentElement.scrollHeight") <= 12 * 900
    box = page.locator(".intro .wall").bounding_box()
    assert box["y"] + box["height"] < 900
    assert page.locator(".intro .wall figure").count() == 4, "three samplers and the reference"


def test_with_webgl_the_first_page_begins_with_the_playground(launch, address):
    """It has no more screens, and the claim below it holds for what it shows."""
    page = launch(GRAPHICS).new_page(viewport={"width": 1400, "height": 900})
    page.goto(f"{(address / 'index.html').as_uri()}#left=random&right=z-hash&scene=checkerboard&spp=64")
    page.wait_for_selector(".live[data-state=finished]", timeout=60000)
    assert not page.locator(".intro .wall").is_visible()
    box = page.locator(".live .stage").bounding_box()
    assert box["y"] + box["height"] < 900
    assert page.evaluate("document.documentElement.scrollHeight") <= 12 * 900
    random, z = (float(text.split("error ")[1]) for text in page.locator(".legend span").all_inner_texts())
    assert 2 * z <= 1.05 * random


def test_claims_are_filtered_by_verdict_paper_and_words(visit):
    page = visit("ledger.html")
    every = rows(page).count()
    verdicts = [row.get_attribute("data-verdict") for row in rows(page).all()]
    for verdict in dict.fromkeys(verdicts):
        chip = page.locator(f".chip.{verdict}")
        assert int(chip.locator("b").inner_text()) == verdicts.count(verdict)
        chip.focus()
        page.keyboard.press("Enter")
        page.wait_for_function("document.querySelector('.chip[aria-current=true]')")
        assert {row.get_attribute("data-verdict") for row in rows(page).all()} == {verdict}
        assert rows(page).count() == verdicts.count(verdict)
        assert page.locator("#ledger-shown").inner_text().startswith(f"{verdicts.count(verdict)} of")
        chip.click()
        page.wait_for_function("!document.querySelector('.chip[aria-current=true]')")
        assert rows(page).count() == every
    page.select_option("#ledger-paper", "hilbert")
    page.wait_for_function("location.hash === '#hilbert'")
    assert {text.split(",")[0] for text in rows(page).locator("td:first-child").all_inner_texts()} == {
        "Hilbert"
    }
    page.fill("#ledger-search", "MOORE fewer")
    assert 0 < rows(page).count() < every
    page.fill("#ledger-search", "no such word")
    assert rows(page).count() == 0


def test_a_count_leads_to_the_claims_that_it_counts(visit):
    """From the first page, the address filters; what differs comes first."""
    page = visit()
    counts = [
        (each.get_attribute("href"), each.inner_text()) for each in page.locator("#claims a.verdict").all()
    ]
    assert counts
    for place, text in counts:
        page.goto(page.url.rpartition("/")[0] + "/" + place)
        _, count, verdict = text.split()
        assert rows(page).count() == int(count)
        assert {row.get_attribute("data-verdict") for row in rows(page).all()} == {verdict}
    page.evaluate("location.hash = 'differs'")
    page.wait_for_function("document.querySelector('#ledger-paper').value === ''")
    assert {row.get_attribute("data-verdict") for row in rows(page).all()} <= {"differs"}


def test_claims_are_sorted_by_any_column_and_back(visit):
    page = visit("ledger.html")
    for column, name in enumerate(["Place", "Claim", "Verdict", "Measured", "Shown by"]):
        head = page.locator("#ledger-table th").nth(column)
        head.get_by_role("button", name=name).click()
        assert head.get_attribute("aria-sort") == "ascending"
        up = rows(page).locator(f"td:nth-child({column + 1})").all_inner_texts()
        page.keyboard.press("Enter")
        assert head.get_attribute("aria-sort") == "descending"
        down = rows(page).locator(f"td:nth-child({column + 1})").all_inner_texts()
        assert sorted(up) == sorted(down) and (up != down or len(set(up)) == 1)
    assert page.locator("#ledger-table th[aria-sort=none]").count() == 4


def test_the_split_follows_mouse_and_keys(visit):
    """It shows as much of the left image as lies left of it."""
    page = visit("thesis.html")
    viewer = page.locator("#thesis-6\\.1 .viewer")
    split, left = viewer.locator(".split"), viewer.locator(".over")
    split.scroll_into_view_if_needed()
    box = split.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 4, box["y"] + 9)
    assert float(split.input_value()) == pytest.approx(64, abs=2), "of 256 pixels"
    assert left.evaluate("image => image.style.clipPath").startswith("inset(0px 7")
    page.mouse.move(box["x"] + box["width"] / 4, box["y"] + 9)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 9)
    page.mouse.up()
    assert float(split.input_value()) == pytest.approx(128, abs=2)
    split.focus()
    before = int(split.input_value())
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
    assert int(split.input_value()) == before + 1
    page.keyboard.press("Home")
    assert left.evaluate("image => image.style.clipPath") == "inset(0px 100% 0px 0px)"
    assert "jittered grid" in split.get_attribute("aria-valuetext")


def test_what_is_under_the_pointer_is_magnified_in_both(visit):
    page = visit("thesis.html")
    viewer = page.locator("#thesis-6\\.1 .viewer")
    lenses = viewer.locator(".magnified")
    lenses.first.scroll_into_view_if_needed()
    place = "lens => lens.style.backgroundPosition"
    stage = viewer.locator(".stage")
    stage.hover(position={"x": 100, "y": 100})
    first = [lens.evaluate(place) for lens in lenses.all()]
    stage.hover(position={"x": 300, "y": 200})
    second = [lens.evaluate(place) for lens in lenses.all()]
    assert first[0] == first[1] != second[0] == second[1]
    lenses.nth(1).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowDown")
    third = [lens.evaluate(place) for lens in lenses.all()]
    steps = [
        float(a) - float(b)
        for a, b in zip(*(t[0].replace("px", "").split() for t in (second, third)), strict=True)
    ]
    assert third[0] == third[1] and steps[1] == 8 * steps[0] > 0

    viewer.get_by_role("radio", name="Difference").check(force=True)
    assert "difference" in lenses.first.evaluate("lens => lens.style.backgroundImage")
    assert "difference" in viewer.locator(".over").get_attribute("src")
    viewer.get_by_label("Left of the split").select_option("exact reference")
    assert viewer.locator(".over").get_attribute("src") == "thesis-6.1.exact-reference.webp"


@pytest.mark.parametrize(("place", "samplers"), [("index.html", 3), ("ours.html#spp-slider", 3)])
def test_all_samplers_follow_the_slider(visit, place, samplers):
    page = visit(place)
    wall = page.locator(".wall[data-name=spp-slider]")
    wall.scroll_into_view_if_needed()
    slider = wall.locator("input.spp")
    slider.focus()
    page.keyboard.press("End")
    assert wall.locator("output").inner_text() == "256 spp"
    sources = [image.get_attribute("src") for image in wall.locator("img").all()]
    assert len(sources) == samplers + 1 and all("-256-spp" in source for source in sources[1:])
    page.keyboard.press("Home")
    assert "-1-spp" in wall.locator("img").nth(1).get_attribute("src")

    def errors():
        told = wall.locator("figure small").all_inner_texts()[1:]
        return [float(text.split()[-1]) for text in told]

    worse = errors()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    assert wall.locator("output").inner_text() == "64 spp"
    random, *others = errors()
    assert all(2 * other <= 1.05 * random for other in others), "half as much, as the first page says"
    page.keyboard.press("End")
    assert all(best < worst for best, worst in zip(errors(), worse, strict=True))


@pytest.mark.parametrize("scale", [1, 1.25, 2, 3])
def test_pictures_fit_and_enlarged_have_whole_pixels_of_the_screen(visit, scale):
    page = visit("thesis.html", device_scale_factor=scale)
    link = page.locator("#thesis-6\\.1 .enlarge")
    image = link.locator("img")

    def zoom(each):
        return each.evaluate(
            "image => image.getBoundingClientRect().width * devicePixelRatio / image.naturalWidth"
        )

    image.scroll_into_view_if_needed()
    page.wait_for_function("image => image.naturalWidth > 0", arg=image.element_handle())
    assert page.evaluate(
        "[...document.querySelectorAll('.enlarge')].every(e => e.scrollWidth <= e.clientWidth)"
    )
    fitting = image.bounding_box()
    link.focus()
    page.keyboard.press("Enter")
    assert zoom(image) == pytest.approx(round(scale), abs=0.01)
    assert image.evaluate("image => getComputedStyle(image).imageRendering") == "pixelated"
    link.click()
    assert image.bounding_box()["width"] == fitting["width"]
    viewer = page.locator("#thesis-6\\.1 .viewer")
    viewer.scroll_into_view_if_needed()
    page.wait_for_function("stage => stage.naturalWidth > 0", arg=viewer.locator(".over").element_handle())
    found = zoom(viewer.locator(".over"))
    assert found == pytest.approx(round(found), abs=0.01) and found >= 1


def test_who_comes_for_a_figure_sees_its_claims(visit):
    page = visit("thesis.html#thesis-6.1")
    assert page.locator("#thesis-6\\.1 .claims li").first.is_visible()
    assert not page.locator("#thesis-6\\.2 .claims li").first.is_visible()


def test_colours_are_those_of_the_system_until_one_chooses(visit):
    page = visit(color_scheme="dark")
    colour = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(colour)
    button = page.get_by_role("button", name="Colours")
    button.click()
    light = page.evaluate(colour)
    assert light != dark
    page.reload()
    assert page.evaluate(colour) == light, "the choice is kept"
    button.click()
    assert page.evaluate(colour) == dark
    button.click()
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"{colour} === {light!r}")


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [320, 390, 768, 1400])
def test_a_narrow_screen_scrolls_down_only(visit, width, name):
    page = visit(name, viewport={"width": width, "height": 800}, device_scale_factor=2)
    assert page.evaluate("document.documentElement.scrollWidth") == width


def test_numbers_unfold(visit):
    page = visit("thesis.html")
    numbers = page.locator("#thesis-6\\.1 .numbers")
    numbers.locator("summary").first.click()
    numbers.locator("summary", has_text="measured").click()
    numbers.locator("summary", has_text="rms_error").click()
    numbers.locator("p", has_text="Hammersley").first.wait_for()
    assert "qmcjax thesis-6.1" in numbers.locator(".facts").inner_text()


@pytest.mark.parametrize("name", PAGES)
def test_everything_that_can_be_used_shows_that_it_has_the_focus(visit, name):
    page = visit(name)
    for _ in range(12):
        page.keyboard.press("Tab")
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert page.evaluate(outline) == "solid", page.evaluate("document.activeElement.outerHTML")[:200]
