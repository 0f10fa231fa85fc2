"""What figures draw with: the table of samplers, and drawings of points, orders, images, spectra, errors."""

import matplotlib
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import analysis
from figures import plot
from figures.ours import designed_tiles, mitsuba_samplers, screen_space, spp_slider
from figures.shared.rivals import RIVALS
from figures.shared.timing import speed_sweep
from figures.z import z_12
from qmcjax import orders, sequences


@pytest.fixture
def ax():
    return Figure(figsize=(4, 4), dpi=100).subplots()


def test_colour_marker_and_line_together_are_one_samplers():
    styles = list(plot.SAMPLERS.values())
    round_ones = str.maketrans(".8hH", "oooo")
    assert len({(each.color, each.marker.translate(round_ones)) for each in styles}) == len(styles)
    # On white: a contrast of at least 2 to 1, but for yellow, which is drawn with a marker of its own.
    assert sum(np.dot(to_rgb(each.color), (0.2126, 0.7152, 0.0722)) > 0.75 for each in styles) <= 1


def test_no_two_samplers_of_one_figure_look_alike():
    figures = {
        "screen-space": screen_space.methods(),
        "spp-slider": spp_slider.ways(4),
        "benchmark": speed_sweep.SAMPLERS,
        "mitsuba-samplers": map(mitsuba_samplers.shown, mitsuba_samplers.SIZES["paper"].samplers),
        "designed-samplers": (designed_tiles.OURS, *designed_tiles.RIVALS),
        "compare": [rival.name for rival in RIVALS.values()],
        "z-12": z_12.NAMES.values(),
    }
    for figure, of in figures.items():
        names = list(of)
        styles = {plot.style(name, names)[:2] for name in names}
        assert len(styles) == len(names), figure


def test_samplers_that_are_not_in_the_table_are_told_apart():
    names = ["Z", "mine", "yours", "theirs"]
    assert len({plot.style(name, names) for name in names}) == 4
    assert plot.style("(0,2)") == plot.style("(0,2)-sequence") == plot.SAMPLERS["(0,2), Owen"]
    with pytest.raises(TypeError, match="name must be the name of a sampler, got 3"):
        plot.style(3)


def test_no_point_of_a_net_is_on_a_border(ax):
    net = np.asarray(sequences.hammersley_net(4).points(16))
    drawn = plot.points(net, cells=(4, 4), ax=ax).lines[-1].get_xydata()
    np.testing.assert_allclose(drawn, net + 1 / 32, atol=0)
    assert len(ax.lines) == 1 + 3 + 3


def test_other_points_are_where_they_are(ax):
    given = np.random.default_rng(1).random((20, 2))
    np.testing.assert_array_equal(plot.points(given, ax=ax).lines[-1].get_xydata(), given)


def test_a_way_through_pixels_has_gaps_where_it_leaves_the_image(ax):
    path = plot.order(orders.hilbert(5, 3), ax=ax).lines[0].get_xydata()
    steps = np.abs(np.diff(path, axis=0)).sum(axis=1)
    assert np.isnan(path).any() and set(steps[~np.isnan(steps)]) == {1.0}
    assert len({tuple(pixel) for pixel in path[~np.isnan(path[:, 0])]}) == 15


def pixels(figure):
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3]


@pytest.mark.parametrize("shape", [(8, 8), (5, 9, 3)])
def test_no_image_is_resampled(shape):
    """Each pixel is a square of zoom**2 equal ones, and all are there."""
    rng = np.random.default_rng(2)
    given = rng.integers(0, 256, shape) / 255
    with matplotlib.rc_context({"savefig.dpi": "figure"}):
        figure = plot.image(given, zoom=7, title="t")
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        FigureCanvasAgg(figure)
        shown = pixels(figure)
    box = figure.axes[0].get_window_extent()
    x, y = round(box.x0), round(shown.shape[0] - box.y1)
    area = shown[y : y + 7 * shape[0], x : x + 7 * shape[1]]
    expected = np.kron(given.reshape(*shape[:2], -1), np.ones((7, 7, 1))) * 255
    np.testing.assert_allclose(area, np.broadcast_to(expected, area.shape), atol=1)


def test_transfer_is_that_of_srgb():
    shown = (
        plot.image(np.array([[0.0, 0.002, 0.2140411, 1.0]]), transfer="srgb").axes[0].images[0].get_array()
    )
    np.testing.assert_allclose(shown, [[0, 0.02584, 0.5, 1]], atol=1e-5)


def test_errors_are_drawn_around_grey():
    shown = plot.difference(np.array([[1.0, 2.0, 3.0]]), np.full((1, 3), 2.0), scale=2.0).axes[0].images[0]
    np.testing.assert_allclose(shown.get_array(), [[0.25, 0.5, 0.75]])


def test_names_of_curves_do_not_overlap(ax):
    errors = {f"sampler {k}": [1.0, 0.1 + 0.001 * k, 0.01 + 0.0001 * k] for k in range(8)}
    plot.convergence([1, 4, 16], errors, ax=ax)
    places = sorted(text.xyann[1] for text in ax.texts if text.get_text().startswith("sampler"))
    assert len(places) == 8 and np.diff(places).min() >= 0.0549


def test_spectra_are_radial_means(ax):
    noise = analysis.error_spectrum(np.random.default_rng(3).random((32, 32)), np.zeros((32, 32)))
    plot.spectrum({"random": noise}, ax=ax)
    frequency, mean = analysis.radial_average(noise)
    np.testing.assert_allclose(ax.lines[0].get_xydata(), np.stack([frequency / 32, mean], axis=1))
