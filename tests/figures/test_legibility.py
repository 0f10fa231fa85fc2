"""Figures can be printed: each is as wide as a column or a page, no letter is small, no texts overlap."""

import subprocess
import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from figures import plot
from figures._rc import COLUMN, PAGE
from figures.making import store
from figures.making.legibility import faults

ROOT = Path(__file__).parents[2]


def drawn(width=COLUMN, height=2.5, *, xlabel="samples per pixel", ylabel="RMS error"):
    with plot.rc():
        figure = Figure(figsize=(width, height), layout="constrained", dpi=300)
        axes = figure.subplots()
        axes.plot([1, 4, 16], [0.4, 0.2, 0.1])
        axes.set(xlabel=xlabel, ylabel=ylabel)
    return figure, axes


def faults_of(figure):
    figure.draw_without_rendering()
    return faults(figure)


@pytest.mark.parametrize("width", [COLUMN, PAGE])
def test_a_plain_figure_has_no_fault(width):
    assert faults_of(drawn(width)[0]) == []


@pytest.mark.parametrize(
    "options, fault",
    [
        ({"width": 12}, "12.00 x 2.50 inches"),
        ({"height": 11}, "3.30 x 11.00 inches"),
        ({"xlabel": ""}, "the x axis of '' has no name"),
        ({"ylabel": ""}, "the y axis of '' has no name"),
    ],
)
def test_faults_of_figures_and_axes_are_named(options, fault):
    assert faults_of(drawn(**options)[0]) == [fault]


def test_small_letters_overlaps_and_texts_that_leave_are_named():
    figure, axes = drawn()
    axes.text(8, 0.3, "small", fontsize=7)
    axes.text(8, 0.2, "under")
    axes.text(8.3, 0.2, "over")
    axes.text(16, 0.2, "far too long a text for the end of a curve")
    for text in axes.texts:
        text.set_in_layout(False)
    assert faults_of(figure) == [
        "'small' has 7 pt",
        "'far too long a text for the end of a curve' leaves the figure",
        "'under' overlaps 'over'",
    ]


def test_labels_of_ticks_outside_of_the_axes_are_not_there():
    figure, axes = drawn()
    axes.set_xticks([1, 4, 16, 16.01])
    axes.set_xlim(1, 16)
    assert faults_of(figure) == []
    axes.set_xticks([1, 4, 15.9, 16])
    assert faults_of(figure) == ["'15.9' overlaps '16.0'"]


def test_labels_below_a_logarithmic_axis_of_many_decades_are_not_there():
    figure, axes = drawn()
    axes.set(yscale="log", yticks=[1e-11, 1e-9, 1e-7, 1e-3], ylim=(4e-8, 1))
    assert faults_of(figure) == []


def test_lines_from_names_to_their_curves_are_no_part_of_the_names():
    figure, axes = drawn()
    for name, y in (("steep", 0.35), ("level", 0.1)):
        axes.annotate(name, (1, 0.1), (4, y), arrowprops={"arrowstyle": "-"})
    assert faults_of(figure) == []


@pytest.mark.slow
def test_drafts_of_all_figures_can_be_printed(drafts):
    command = [sys.executable, "-m", "figures", "--all", "--out", str(drafts)]
    subprocess.run(command, cwd=ROOT, check=True)
    entries = store.read_numbers(drafts)
    assert {name: entry["illegible"] for name, entry in entries.items() if "illegible" in entry} == {}
