"""Debian's chromium, for the tests of pages."""

import pytest
import webgl


@pytest.fixture(scope="session")
def launch():
    """Return what starts a browser, with graphics by software or without."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = {}

        def launch(graphics):
            if graphics not in started:
                options = [*webgl.OPTIONS[1:], *(webgl.GRAPHICS if graphics else webgl.NO_GRAPHICS)]
                started[graphics] = playwright.chromium.launch(executable_path=webgl.CHROMIUM, args=options)
            return started[graphics]

        yield launch
        for browser in started.values():
            browser.close()


@pytest.fixture
def opened(launch):
    """Return what opens a page at an address; in the end, nothing may have been wrong with it."""
    pages, wrong = [], []

    def failed(request):
        if request.failure != "net::ERR_ABORTED":  # The slider moved on before an image was read.
            wrong.append(request.url)

    def elsewhere(request):
        if not request.url.startswith(("file:", "data:", "blob:")):
            wrong.append(request.url)

    def opened(address, graphics=False, **options):
        page = launch(graphics).new_page(**({"viewport": {"width": 1400, "height": 900}} | options))
        page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("requestfailed", failed)
        page.on("request", elsewhere)
        page.goto(address)
        pages.append(page)
        return page

    yield opened
    for page in pages:
        page.close()
    assert wrong == []
