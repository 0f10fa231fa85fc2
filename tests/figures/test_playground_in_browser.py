"""The playground in Debian's chromium: the bits of Python, its controls, and what disturbs it."""

import base64
import re

import numpy as np
import playgrounds
import pytest
import webgl

import analysis
from figures import page, plot
from figures.playground import KEYS, SAMPLERS, SCENES, playground
from qmcjax import samplers, sequences

pytestmark = [pytest.mark.browser, pytest.mark.skipif(webgl.CHROMIUM is None, reason="no chromium")]

SIDE = playgrounds.SIDE
HTML = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>t</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">
<link rel="stylesheet" href="page.css"></head><body><main>
<button id="theme">auto</button>@PLAYGROUND@</main><script src="page.js"></script></body></html>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the page of our playground."""
    return written(tmp_path_factory.mktemp("playground"), playgrounds.packed().script)


def written(where, script):
    """Write a page that has nothing but a playground, and a text in its place."""
    (where / "data.js").write_text(script)
    (where / page.SCRIPT).write_text(page.playground_script())
    (where / "page.css").write_text(page.static("style.css"))
    scripts = ("theme.js", "zoom.js", "viewer.js")
    (where / "page.js").write_text("\n".join(page.static(name) for name in scripts))
    shown = page.playground(where, "data.js", page.Markup("<p>The picture of today.</p>"))
    (where / "index.html").write_text(HTML.replace("@PLAYGROUND@", shown))
    return where


@pytest.fixture
def visit(opened, folder):
    def visit(place="", graphics=True, where=folder, **options):
        place = place and f"{place}&filter=none&view=file"
        return opened(f"{(where / 'index.html').as_uri()}{place}", graphics, **options)

    return visit


def finished(tab, timeout=60000):
    tab.wait_for_selector(".live[data-state=finished]", timeout=timeout)
    return tab


def errors(tab):
    """Return the errors of both sides."""
    told = tab.locator(".legend span").all_inner_texts()
    return [float(re.search(r"error ([\d.e-]+)", text)[1]) for text in told]


def choose(tab, **choice):
    """Choose by the controls."""
    for name, value in choice.items():
        tab.select_option(f"select[name={name}]", value)


RENDER = """async ([scene, spp, key, parts]) => {
  window.data ??= await unpacked(window.playgroundData);
  window.ask ??= asker(accumulating);
  if (!await ask("open", data.side)) throw "no WebGL 2";
  const found = {};
  for (const { id, name } of data.samplers) {
    const program = programOf(data, id, scene, spp, key);
    let sums, first = 0;
    for (const last of parts) {
      ({ sums } = await ask("add", { at: 0, program, first, last, reading: last === spp }));
      first = last;
    }
    const bytes = new Uint8Array(sums.buffer);
    let text = "";
    for (let k = 0; k < bytes.length; k += 8192) text += String.fromCharCode(...bytes.subarray(k, k + 8192));
    found[name] = btoa(text);
  }
  return found;
}"""


def rendered(tab, scene, spp, key, parts):
    found = tab.evaluate(RENDER, [scene.replace(" ", "-"), spp, key, parts])
    return {name: np.frombuffer(base64.b64decode(text), "<f4") for name, text in found.items()}


ROUNDED = {"zone plate": 2.0**-21, "gaussian": 2.0**-21}
"""How far values are off at most, where a sine or an exponential is rounded in another way."""

TURNED = {"defocused edge": 8}
"""In how many of the pixels a sample is on the other side of an edge, by the sine of its lens."""


@pytest.mark.parametrize("scene", SCENES)
def test_images_have_the_bits_of_python(visit, scene):
    """Sums of all samplers, whether all samples are added at once or in parts."""
    tab = finished(visit())
    for parts in ([16], [1, 2, 4, 7, 16]):
        found = rendered(tab, scene, 16, 3, parts)
        assert list(found) == list(SAMPLERS)
        for name, image in found.items():
            wanted = playgrounds.sums(name, scene, 16, 3)
            off = np.abs(image - wanted)
            if scene in ROUNDED:
                assert off.max() <= 16 * ROUNDED[scene], name
            elif scene in TURNED:
                assert np.count_nonzero(off) <= TURNED[scene] and set(off) <= {0, 1}, name
            else:
                assert np.array_equal(image.view(np.uint32), wanted.view(np.uint32)), name


def test_without_webgl_the_picture_of_today_stands(visit):
    tab = visit(graphics=False)
    tab.wait_for_timeout(1000)
    assert tab.evaluate("new OffscreenCanvas(1, 1).getContext('webgl2')") is None
    assert tab.get_by_text("The picture of today.").is_visible() and not tab.locator(".live").is_visible()


CANVAS = (
    """canvas => Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data)"""
)


def greys(tab, side):
    pixels = np.array(tab.locator(f"canvas.{side}").evaluate(CANVAS)).reshape(SIDE, SIDE, 4)
    assert (pixels[..., 3] == 255).all() and (pixels[..., :1] == pixels[..., :3]).all()
    return pixels[..., 0].astype(float)


MEASURES = {
    "none": lambda image, exact: np.sqrt(np.mean((image - exact) ** 2)),
    "gaussian": analysis.filtered_error,
    "eye": analysis.perceived_error,
}


def image_of(name, scene, spp, key):
    return playgrounds.sums(name, scene, spp, key).reshape(SIDE, SIDE).astype(np.float64) / spp


def known_errors(names, scene, spp, key):
    """Return RMS errors, with the three digits that are shown."""
    exact = SCENES[scene]().reference(SIDE, SIDE)[0]
    found = [np.sqrt(np.mean((image_of(name, scene, spp, key) - exact) ** 2)) for name in names]
    return pytest.approx(found, rel=6e-3)


def test_errors_and_pictures_are_those_of_analysis(visit):
    """On both sides, for all filters; the address says what is shown."""
    scene, names = "soft shadow", ("Z, hash", "(0,2), Owen")
    tab = finished(visit("#left=z-hash&right=0-2-owen&scene=soft-shadow&spp=16&key=5"))
    exact = SCENES[scene]().reference(SIDE, SIDE)[0]
    images = [image_of(name, scene, 16, 5) for name in names]
    for name, measure in MEASURES.items():
        choose(tab, filter=name)
        tab.wait_for_function(f"location.hash.includes('filter={name}') || '{name}' === 'none'")
        assert errors(tab) == pytest.approx([measure(image, exact) for image in images], rel=6e-3)
    choose(tab, filter="none")
    tab.wait_for_timeout(300)
    assert np.abs(greys(tab, "left") - 255 * plot.srgb(images[0])).max() < 2

    tab.get_by_role("radio", name="Difference").check(force=True)
    tab.locator(".stage-note", has_text="mid-grey is none").wait_for()
    scale = float(re.search(r"white \+([\d.e-]+)", tab.locator(".stage-note").inner_text())[1])
    for side, image in zip(("left", "right"), images, strict=True):
        off = greys(tab, side) - 127.5 - 127.5 * np.clip((image - exact) / scale, -1, 1)
        assert np.abs(off).max() < 1

    tab.get_by_role("radio", name="Spectrum").check(force=True)
    tab.locator(".stage-note", has_text="Power spectrum").wait_for()
    for side, image in zip(("left", "right"), images, strict=True):
        power = np.fft.fftshift(analysis.error_spectrum(image, exact))
        wanted = 255 * (np.log10(np.clip(power, 1e-2, 1e2)) + 2) / 4
        assert np.abs(greys(tab, side) - wanted).max() < 1
    assert "view=spectrum" in tab.url


def test_curves_are_errors_of_the_first_samples(visit):
    """Logarithms of errors of 1, 2, 4, ..., 64 samples, on one scale."""
    tab = finished(visit("#left=random&right=hilbert-owen-sobol&scene=disc&spp=64&key=2"))
    heights = "dots => dots.map(dot => Number(dot.getAttribute('cy')))"
    dots = [tab.locator(f"circle.{side}").evaluate_all(heights) for side in ("left", "right")]
    assert [len(each) for each in dots] == [7, 7]
    high, low = np.log10(errors(tab))
    assert errors(tab) == known_errors(("random", "Hilbert, Owen-Sobol'"), "disc", 64, 2)
    first = high + (dots[0][-1] - dots[0][0]) * (high - low) / (dots[1][-1] - dots[0][-1])
    reference = SCENES["disc"]().reference(SIDE, SIDE)[0].ravel()
    one = playgrounds.sums("random", "disc", 64, 2, first=1) - reference
    assert first == pytest.approx(np.log10(np.sqrt(np.mean(one**2))), abs=0.02)


def test_every_control_changes_what_is_shown_and_the_address(visit):
    tab = finished(visit())
    assert len(set(errors(tab))) == 2 and "#" not in tab.url
    assert not tab.get_by_text("The picture of today.").is_visible()
    assert not tab.locator(".loading").is_visible()
    random, z = errors(tab)
    assert 1.5 * z < random, "the filtered errors of one sample"
    choose(tab, left="designed-tiles", right="exact", scene="zone-plate", key=str(KEYS[-1]), filter="none")
    tab.locator("input.spp").focus()
    tab.keyboard.press("End")
    finished(tab)
    for part in ("left=designed-tiles", "right=exact", "scene=zone-plate", f"key={KEYS[-1]}", "spp=256"):
        assert part in tab.url
    tab.wait_for_function("document.querySelector('.legend').textContent.includes('256 spp')")
    told = tab.locator(".legend li.left span").inner_text()
    wanted = known_errors(("designed tiles",), "zone plate", 256, KEYS[-1])
    assert [float(told.split("error ")[1])] == wanted
    assert tab.locator(".caption").all_inner_texts() == ["designed tiles", "exact image"]
    assert {"RMS error", "samples per pixel"} <= set(tab.locator(".plot text").all_text_contents())
    assert "The scene “zone plate” at 256 spp" in tab.locator(".stage-note").inner_text()
    # Who is sent the address sees the same.
    other = finished(visit(tab.url[tab.url.index("#") :]))
    assert other.locator(".legend li.left span").inner_text() == told
    other.evaluate("location.hash = '#left=r2-rotated&right=nonsense&spp=1'")
    other.wait_for_function("document.querySelector('select[name=left]').value === 'r2-rotated'")
    assert finished(other).locator("input.spp").input_value() == "0"
    split, over = other.locator(".split"), other.locator("canvas.left")
    split.focus()
    other.keyboard.press("Home")
    assert over.evaluate("canvas => canvas.style.clipPath") == "inset(0px 100% 0px 0px)"


def test_quick_changes_end_in_what_was_chosen_last(visit):
    tab = visit("#spp=256")
    tab.wait_for_selector(".live:not([hidden])", timeout=60000)
    ids = tab.locator("select[name=left] option").evaluate_all("options => options.map(each => each.value)")
    for k in range(24):
        scene = ("disc", "triangle")[k % 2]
        choose(tab, left=ids[k % 12], right=ids[(5 * k + 3) % 12], scene=scene, key=str(1 + k % 4))
    choose(tab, left="z-hash", right="random", scene="disc", key="2")
    tab.locator("input.spp").focus()
    for key in ("End", "Home", "ArrowRight", "End", "Home", "ArrowRight"):
        tab.keyboard.press(key)
    tab.wait_for_function("document.querySelector('.legend').textContent.includes('4 spp')")
    assert errors(finished(tab)) == known_errors(("Z, hash", "random"), "disc", 4, 2)


def test_a_lost_graphics_card_is_waited_for(visit):
    """While it renders, and when it has finished: what is chosen afterwards is as it should be."""
    tab = finished(visit("#left=random&right=z-hash&scene=disc&spp=256"))
    worker = next(each for each in tab.workers if each.evaluate("'gl' in answers"))
    worker.evaluate("""() => {
        const { gl } = answers;
        const draw = gl.drawArrays.bind(gl);
        let calls = 0;
        globalThis.card = gl.getExtension("WEBGL_lose_context");
        gl.drawArrays = (...given) => {
            draw(...given);
            if (++calls === 100) card.loseContext();
        };
    }""")
    choose(tab, left="0-2-owen")
    tab.locator(".stage-note", has_text="has lost the graphics card").wait_for()
    assert tab.locator(".live").get_attribute("data-state") == "rendering"
    worker.evaluate("card.restoreContext()")
    assert errors(finished(tab)) == known_errors(("(0,2), Owen", "Z, hash"), "disc", 256, 1)
    worker.evaluate("card.loseContext(); setTimeout(() => card.restoreContext(), 50)")
    tab.wait_for_timeout(300)
    choose(tab, right="random")
    assert errors(finished(tab)) == known_errors(("(0,2), Owen", "random"), "disc", 256, 1)


@pytest.mark.parametrize("width", [320, 390, 768, 1400])
def test_it_fits_the_screen_and_resizes(visit, width):
    """Pixels of images are whole pixels of the screen."""
    tab = finished(visit(viewport={"width": width, "height": 844}, device_scale_factor=2))
    assert tab.evaluate("document.documentElement.scrollWidth") == width
    zoom = "canvas => canvas.getBoundingClientRect().width * devicePixelRatio / canvas.width"
    for size in (width, 360):
        tab.set_viewport_size({"width": size, "height": 700})
        tab.wait_for_timeout(100)
        found = tab.locator("canvas.left").evaluate(zoom)
        assert found == pytest.approx(round(found), abs=0.01) and found >= 1
        assert tab.evaluate("document.documentElement.scrollWidth") == size


def test_a_side_that_cannot_be_rendered_says_why(visit, tmp_path):
    """Too few dimensions, a number of samples that a sampler does not have; the other side is rendered."""
    makers = {
        "flat": lambda spp, key: samplers.independent(sequences.sobol(2), key),
        "Z": lambda spp, key: samplers.z(32, 32, spp, key, dims=4),
        "any": lambda spp, key: samplers.independent(sequences.sobol(4), key),
    }
    worlds = {name: (SCENES[name](), SCENES[name]().reference(32, 32)[0]) for name in ("ball", "disc")}
    written(tmp_path, playground(makers, worlds, 32, (4, 6), (1,)).script)
    tab = visit("#left=flat&right=any&scene=ball&spp=6", where=tmp_path)
    legend = finished(tab).locator(".legend span")
    assert legend.nth(0).inner_text() == "it has 2 dimensions, the scene needs 3"
    assert legend.nth(1).inner_text().startswith("6 spp, error 0.")
    choose(tab, left="z", scene="disc")
    finished(tab)
    assert legend.nth(0).inner_text() == "not at 6 spp: spp must be a power of two, got 6"
    pixels = tab.locator("canvas.left").evaluate(CANVAS)
    assert not any(pixels), "nothing of what was there before"
    tab.locator("input.spp").focus()
    tab.keyboard.press("Home")
    finished(tab)
    assert all(text.startswith("4 spp, error 0.") for text in legend.all_inner_texts())
