"""What figures draw with: the table of samplers, and drawings of points, orders, images, spectra, errors."""

import io
import subprocess
import sys
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from refusals import refused

import analysis
from analysis import ConvergenceRow, ConvergenceTable
from figures import plot
from figures._rc import COLUMN
from figures.making import store
from figures.making.legibility import faults
from figures.making.web_images import encode
from qmcjax import orders, sequences


@pytest.fixture
def ax():
    return Figure(figsize=(4, 4), dpi=100).subplots()


def test_samplers_that_are_not_in_the_table_are_told_apart():
    names = ["Z", "mine", "yours", "theirs"]
    assert len({plot.style(name, names) for name in names}) == 4
    assert plot.style("(0,2)") == plot.style("(0,2)-sequence") == plot.SAMPLERS["(0,2), Owen"]


def test_points_of_a_net_are_between_borders_and_others_where_they_are(ax):
    net, other = np.asarray(sequences.hammersley_net(4).points(16)), np.random.default_rng(1).random((20, 2))
    drawn = plot.points(net, cells=(4, 4), ax=ax).lines[-1].get_xydata()
    np.testing.assert_allclose(drawn, net + 1 / 32, atol=0)
    assert len(ax.lines) == 1 + 3 + 3
    np.testing.assert_array_equal(plot.points(other, ax=ax).lines[-1].get_xydata(), other)


def test_a_way_through_pixels_has_gaps_where_it_leaves_the_image(ax):
    path = plot.order(orders.hilbert(5, 3), ax=ax).lines[0].get_xydata()
    steps = np.abs(np.diff(path, axis=0)).sum(axis=1)
    assert np.isnan(path).any() and set(steps[~np.isnan(steps)]) == {1.0}
    assert len({tuple(pixel) for pixel in path[~np.isnan(path[:, 0])]}) == 15


@pytest.mark.parametrize("shape", [(8, 8), (5, 9, 3)])
def test_no_image_is_resampled(shape):
    """Each pixel is a square of zoom**2 equal ones, and all are there."""
    rng = np.random.default_rng(2)
    given = rng.integers(0, 256, shape) / 255
    with matplotlib.rc_context({"savefig.dpi": "figure"}):
        figure = plot.image(given, zoom=7, title="t")
        FigureCanvasAgg(figure)
        figure.canvas.draw()
        shown = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    box = figure.axes[0].get_window_extent()
    x, y = round(box.x0), round(shown.shape[0] - box.y1)
    area = shown[y : y + 7 * shape[0], x : x + 7 * shape[1]]
    expected = np.kron(given.reshape(*shape[:2], -1), np.ones((7, 7, 1))) * 255
    np.testing.assert_allclose(area, np.broadcast_to(expected, area.shape), atol=1)


def test_transfer_is_that_of_srgb_and_errors_are_around_grey():
    linear = np.array([[0.0, 0.002, 0.2140411, 1.0]])
    shown = plot.image(linear, transfer="srgb").axes[0].images[0]
    np.testing.assert_allclose(shown.get_array(), [[0, 0.02584, 0.5, 1]], atol=1e-5)
    shown = plot.difference(np.array([[1.0, 2.0, 3.0]]), np.full((1, 3), 2.0), scale=2.0).axes[0].images[0]
    np.testing.assert_allclose(shown.get_array(), [[0.25, 0.5, 0.75]])


def test_a_table_is_drawn_with_bands_and_slopes(ax):
    """Over keys, names have slopes with intervals; an error of 0 is left out."""
    made = {"Z": [[1.0, 1.1, 0.9, 1.0], [0.5, 0.6, 0.5, 0.4]], "one": [[2.0], [0.0]]}
    keyed = [(name, n, of) for name, errors in made.items() for n, of in zip((1, 4), errors, strict=True)]
    means = [{"whole": float(np.prod(of) ** (1 / len(of)))} for *_, of in keyed]
    rows = [
        ConvergenceRow(name, n, mean, 1.0, 1.0, {"whole": tuple(of)})
        for (name, n, of), mean in zip(keyed, means, strict=True)
    ]
    table = ConvergenceTable(tuple(rows), 0.0)
    plot.convergence(table, ax=ax)
    low, high = table.slope_interval("Z")
    names = {text.get_text() for text in ax.texts}
    assert {f"Z: $n^{{{table.slope('Z'):.2f} \\pm {(high - low) / 2:.2f}}}$", "one"} <= names
    (band,) = ax.collections
    ends = np.concatenate([path.vertices for path in band.get_paths()])
    assert set(np.round(table.bands("Z").ravel(), 12)) <= set(np.round(ends[:, 1], 12))
    for given in ({"errors": {"a": [1.0, 0.5]}}, {"bands": {}}):
        with pytest.raises(ValueError, match=f"{next(iter(given))} must be None"):
            plot.convergence(table, **given)


ROOT = Path(__file__).parents[2]


def test_faults_are_named():
    """Also those of the figure's size and of axes; what is not drawn is none."""
    with plot.rc():
        figure = Figure(figsize=(COLUMN, 2.5), layout="constrained", dpi=300)
        axes = figure.subplots()
        axes.plot([1, 4, 16], [0.4, 0.2, 0.1])
        axes.set(xlabel="samples per pixel", ylabel="RMS error", xticks=[1, 4, 16, 16.01], xlim=(1, 16))
    figure.draw_without_rendering()
    assert faults(figure) == []
    axes.text(8, 0.3, "small", fontsize=7)
    axes.text(8, 0.2, "under")
    axes.text(8.3, 0.2, "over")
    axes.text(16, 0.2, "far too long a text for the end of a curve")
    for text in axes.texts:
        text.set_in_layout(False)
    axes.set_ylabel("")
    figure.draw_without_rendering()
    assert faults(figure) == [
        "'small' has 7 pt",
        "'far too long a text for the end of a curve' leaves the figure",
        "'under' overlaps 'over'",
        "the y axis of '' has no name",
    ]
    figure.set_size_inches(12, 2.5)
    figure.draw_without_rendering()
    assert faults(figure)[0] == "12.00 x 2.50 inches"


@pytest.mark.slow
def test_drafts_of_all_figures_can_be_printed(drafts):
    command = [sys.executable, "-m", "figures", "--all", "--out", str(drafts)]
    subprocess.run(command, cwd=ROOT, check=True)
    entries = store.read_numbers(drafts)
    assert {name: entry["illegible"] for name, entry in entries.items() if "illegible" in entry} == {}


SIDE = 16
GREY = np.full((SIDE, SIDE), 0.25)


def read(file):
    """Return bytes of grey or colours; WebPs have no greys of their own."""
    image = np.asarray(Image.open(io.BytesIO(file)).convert("RGB"))
    return image[..., 0] if (image == image[..., :1]).all() else image


def shades(file):
    """Return the shades of a spectrum from 0, black, to 15, white."""
    assert (read(file) % 17 == 0).all()
    return read(file) // 17


def test_floats_are_linear_values_and_bytes_are_kept():
    files, described = encode({"reference": GREY, "dark": GREY - 1, "bright": GREY + 9})
    assert (read(files["reference.webp"]) == round(255 * (1.055 * 0.25 ** (1 / 2.4) - 0.055))).all()
    assert (read(files["dark.webp"]) == 0).all() and (read(files["bright.webp"]) == 255).all()
    assert "sRGB" in described["transfer"]

    colours = np.arange(SIDE * SIDE * 3, dtype=np.uint8).reshape(SIDE, SIDE, 3)
    files, described = encode({"reference": colours, "other": colours[::-1]})
    assert (read(files["other.webp"]) == colours[::-1]).all()
    assert described["transfer"] == "values as they are"
    assert described["items"][1]["rms"] <= 1, "of the range of bytes"


def test_differences_are_signed_and_of_one_scale_for_as_many_samples():
    steps = np.zeros((SIDE, SIDE))
    steps[:, : SIDE // 2] = 0.04
    images = {"reference": GREY, "Z, 4 spp": GREY + steps, "random, 4 spp": GREY - 2 * steps}
    files, described = encode(images | {"Z, 16 spp": GREY + steps / 40})
    first, *others = described["items"]
    assert first == {"name": "reference", "file": "reference.webp"}
    assert [(item["name"], item["spp"]) for item in others] == [("Z", 4), ("random", 4), ("Z", 16)]
    assert [item["scale"] for item in others] == [0.2, 0.2, 0.005], "three times the largest RMS or more"
    assert others[0]["rms"] == pytest.approx(0.04 / np.sqrt(2))
    too_bright, too_dark = (read(files[item["difference"]]) for item in others[:2])
    assert too_bright[0, 0] == pytest.approx(127.5 * 1.2, abs=1)
    assert too_dark[0, 0] == pytest.approx(127.5 * 0.6, abs=1)
    assert too_bright[0, -1] == too_dark[0, -1] == 128, "mid-grey is none"
    assert read(files[others[2]["difference"]])[0, 0] == pytest.approx(127.5 * 1.2, abs=1)
    waves = np.zeros((SIDE, SIDE))
    waves[:, ::2] = 0.04
    _, described = encode({"reference": GREY, "waves": GREY + waves, "steps": GREY + steps})
    for item, image in zip(described["items"][1:], (waves, steps), strict=True):
        assert item["filtered_rms"] == pytest.approx(analysis.filtered_error(image, 0 * image), rel=1e-6)
    lamp = GREY.copy()
    lamp[3, 4] = 9
    files, _ = encode({"reference": GREY, "lamp": lamp})
    assert read(files["lamp.difference.webp"])[3, 4] == 255


def test_a_wave_is_two_points_of_its_spectrum():
    """At its frequency left and right of the middle; white noise is a grey between black and white."""
    x = np.arange(SIDE)
    wave = np.broadcast_to(np.cos(2 * np.pi * 3 * x / SIDE), (SIDE, SIDE))
    noise = np.random.default_rng(1).normal(size=(SIDE, SIDE))
    files, _ = encode({"reference": GREY, "wave": GREY + wave, "noise": GREY + noise, "none": GREY})
    found = shades(files["wave.spectrum.webp"])
    bright = {tuple(place) for place in np.argwhere(found == 15).tolist()}
    assert bright == {(SIDE // 2, SIDE // 2 - 3), (SIDE // 2, SIDE // 2 + 3)}
    assert 5 < np.mean(shades(files["noise.spectrum.webp"])) < 9
    assert (shades(files["none.spectrum.webp"]) == 0).all()


test_other_things_are_refused = refused(
    ([GREY], TypeError, "images must be a mapping of names to arrays, got list"),
    ({1: GREY}, TypeError, "images must be a mapping of names"),
    ({}, ValueError, "must have a reference"),
    ({"a": GREY, "b": np.ones((SIDE, SIDE), int)}, TypeError, "floats or uint8, got int64 for 'b'"),
    ({"a": GREY, "b": GREY.astype(np.uint8)}, TypeError, "all of floats or all of uint8"),
    ({"a": GREY, "b": GREY[1:]}, ValueError, r"one shape .* got \(15, 16\) for 'b'"),
    ({"a": np.zeros((4, 4, 2))}, ValueError, r"got \(4, 4, 2\) for 'a'"),
    ({"a": GREY, "b": GREY * np.nan}, ValueError, "finite, got others in 'b'"),
    ({"a": GREY, "Z!": GREY, "z": GREY}, ValueError, "differ in letters or digits"),
    call=encode,
)
