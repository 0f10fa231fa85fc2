"""The page in Debian's chromium, on drafts of figures: ``python -m pytest -m browser -n 0 --drafts=out``."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIGURES = ("hilbert-1", "spp-slider", "thesis-6.1")
OPTIONS = """--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
    --disable-component-update --disable-sync"""

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def address(pytestconfig):
    """Bring the drafts up to date that the tests need, and return where the page is."""
    given = pytestconfig.getoption("--drafts")
    folder = Path(given).resolve() if given else pytestconfig.cache.mkdir("figures")
    subprocess.run([sys.executable, "-m", "figures", *FIGURES, "--out", str(folder)], cwd=ROOT, check=True)
    return folder / "index.html"


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=OPTIONS.split())
        yield started
        started.close()


@pytest.fixture
def visit(browser, address):
    """Return what opens the page; in the end, nothing may have been wrong with it."""
    opened, wrong = [], []

    def visit(**options):
        page = browser.new_page(**({"viewport": {"width": 1400, "height": 1000}} | options))
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("requestfailed", lambda request: wrong.append(request.url))
        page.on(
            "request",
            lambda request: None if request.url.startswith(("file:", "data:")) else wrong.append(request.url),
        )
        page.goto(address.as_uri())
        opened.append(page)
        return page

    yield visit
    for page in opened:
        page.close()
    assert wrong == []


def rows(page):
    return page.locator("#ledger-table tbody tr:visible")


def test_it_opens_fast_and_reads_only_files_that_are_there(visit):
    page = visit()
    times = "(t => t.loadEventEnd - t.startTime)(performance.getEntriesByType('navigation')[0])"
    assert page.evaluate(times) < 2000
    for image in page.locator("img").all():
        image.scroll_into_view_if_needed()
    page.wait_for_function("[...document.images].every(image => image.hidden || image.naturalWidth > 0)")
    assert page.evaluate("[...document.images].every(image => image.hidden || image.alt)")


def test_it_weighs_less_than_40_megabytes(address):
    files = [address, *address.parent.glob("*.webp")]
    assert sum(file.stat().st_size for file in files) < 40e6


def test_claims_are_filtered_by_verdict_paper_and_words(visit):
    page = visit()
    every = rows(page).count()
    verdicts = [row.get_attribute("data-verdict") for row in rows(page).all()]
    for verdict in dict.fromkeys(verdicts):
        chip = page.locator(f".chip.{verdict}")
        assert int(chip.locator("b").inner_text()) == verdicts.count(verdict)
        chip.focus()
        page.keyboard.press("Space")
        assert rows(page).count() == every - verdicts.count(verdict)
        assert page.locator("#ledger-shown").inner_text().startswith(f"{every - verdicts.count(verdict)} of")
        chip.click()
    page.select_option("#ledger-paper", "hilbert")
    assert {row.get_attribute("data-paper") for row in rows(page).all()} == {"hilbert"}
    page.fill("#ledger-search", "MOORE fewer")
    assert 0 < rows(page).count() < every
    page.fill("#ledger-search", "no such word")
    assert rows(page).count() == 0


def test_claims_are_sorted_by_any_column_and_back(visit):
    page = visit()
    for column, name in enumerate(["Paper", "Place", "Claim", "Measured", "Verdict", "Why", "Shown by"]):
        head = page.locator("#ledger-table th").nth(column)
        head.get_by_role("button", name=name).click()
        assert head.get_attribute("aria-sort") == "ascending"
        up = rows(page).locator(f"td:nth-child({column + 1})").all_inner_texts()
        page.keyboard.press("Enter")
        assert head.get_attribute("aria-sort") == "descending"
        down = rows(page).locator(f"td:nth-child({column + 1})").all_inner_texts()
        assert sorted(up) == sorted(down) and (up != down or len(set(up)) == 1)
    assert page.locator("#ledger-table th[aria-sort=none]").count() == 6


def test_the_split_follows_mouse_and_keys(visit):
    """It shows as much of the left image as lies left of it."""
    page = visit()
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
    page = visit()
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


def test_all_samplers_follow_the_slider(visit):
    page = visit()
    wall = page.locator("#samples .wall")
    wall.scroll_into_view_if_needed()
    slider = wall.locator("input.spp")
    slider.focus()
    page.keyboard.press("End")
    assert wall.locator("output").inner_text() == "256 spp"
    sources = [image.get_attribute("src") for image in wall.locator("img").all()]
    assert len(sources) == 9 and all("-256-spp" in source for source in sources[1:])
    page.keyboard.press("Home")
    assert "-1-spp" in wall.locator("img").nth(1).get_attribute("src")
    worse = float(wall.locator("figure").nth(1).locator("small").inner_text().split()[-1])
    page.keyboard.press("End")
    assert float(wall.locator("figure").nth(1).locator("small").inner_text().split()[-1]) < worse


@pytest.mark.parametrize("scale", [1, 1.25, 2, 3])
def test_a_pixel_of_a_picture_is_a_whole_number_of_pixels_of_the_screen(visit, scale):
    page = visit(device_scale_factor=scale)
    figure = page.locator("#thesis-6\\.1 .picture")
    image = figure.locator("img")

    def zoom(each):
        return each.evaluate(
            "image => image.getBoundingClientRect().width * devicePixelRatio / image.naturalWidth"
        )

    image.scroll_into_view_if_needed()
    page.wait_for_function("image => image.naturalWidth > 0", arg=image.element_handle())
    found = [zoom(image)]
    figure.get_by_role("button", name="Larger").click()
    found.append(zoom(image))
    viewer = page.locator("#thesis-6\\.1 .viewer")
    viewer.scroll_into_view_if_needed()
    page.wait_for_function("stage => stage.naturalWidth > 0", arg=viewer.locator(".over").element_handle())
    found.append(zoom(viewer.locator(".over")))
    assert found[:2] == pytest.approx([round(scale), round(scale) + 1], abs=0.01)
    assert found[2] == pytest.approx(round(found[2]), abs=0.01) and found[2] >= 1
    assert image.evaluate("image => getComputedStyle(image).imageRendering") == "pixelated"


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


@pytest.mark.parametrize("width", [320, 390, 768])
def test_a_narrow_screen_scrolls_down_only(visit, width):
    page = visit(viewport={"width": width, "height": 800}, device_scale_factor=2)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.locator("#ledger-table tbody tr").first.bounding_box()["width"] <= width or width > 700


def test_numbers_unfold(visit):
    page = visit()
    numbers = page.locator("#thesis-6\\.1 .numbers")
    numbers.locator("summary").first.click()
    numbers.locator("summary", has_text="measured").click()
    numbers.locator("summary", has_text="rms_error").click()
    numbers.locator("p", has_text="Hammersley").wait_for()


def test_everything_that_can_be_used_shows_that_it_has_the_focus(visit):
    page = visit()
    for _ in range(12):
        page.keyboard.press("Tab")
        outline = "getComputedStyle(document.activeElement).outlineStyle"
        assert page.evaluate(outline) == "solid", page.evaluate("document.activeElement.outerHTML")[:200]
