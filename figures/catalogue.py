"""The figures behind the command line: the project's only registry, read without importing any figure."""

import re
from typing import NamedTuple


class Entry(NamedTuple):
    """A figure; what is true of it is said at `OUR_SCENE`, `TIMED` and `LONG`."""

    module: str
    title: str
    our_scene: bool = False
    timed: bool = False
    long: bool = False


class Paper(NamedTuple):
    """A paper: what we call it, and how it is cited."""

    subject: str
    authors: str
    title: str
    published: str
    doi: str = ""


PAPERS = {
    "hilbert": Paper(
        "Rendering along the Hilbert curve",
        "A. Keller, C. Wächter, N. Binder",
        "Rendering along the Hilbert Curve",
        "in Advances in Modeling and Simulation: Festschrift for Pierre L'Ecuyer, 2022",
        "10.1007/978-3-031-10193-9_16",
    ),
    "z": Paper(
        "The Z-sampler",
        "A. G. M. Ahmed, P. Wonka",
        "Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels",
        "ACM Transactions on Graphics 39(6), 2020",
        "10.1145/3414685.3417881",
    ),
    "thesis": Paper(
        "Motion blur, the thesis",
        "L. Grünschloß",
        "Motion Blur",
        "diploma thesis, Ulm University, 2008",
    ),
}
"""The papers, by what the names of their figures begin with."""

TITLES = {
    "thesis-2.1": "Cubic B-spline basis functions",
    "thesis-2.2": "Equal steps in parameter and in arc length",
    "thesis-2.3": "A knot of full multiplicity",
    "thesis-2.4": "Arc length by linear segments",
    "thesis-2.5": "A curve in segments of equal length",
    "thesis-2.6": "Bounds of a rotating rectangle",
    "thesis-2.7": "A fast rotation approximated by linear segments",
    "thesis-2.8": "A jumping ball approximated by linear segments",
    "thesis-3.1.3": "Sliding-window motion blur and moving lines",
    "thesis-3.1.5": "Photons at one time each, and over intervals of time",
    "thesis-3.1.7": "Frameless rendering: pixels in the order of a net",
    "thesis-3.1": "When a ray hits a moving triangle",
    "thesis-3.2": "Visibility along a ray while the shutter is open",
    "thesis-3.2.1": "Analytic and sampled visibility in time, at equal run time",
    "thesis-3.3": "Images predicted in the middle of the shutter",
    "thesis-3.3.4": "Error and bias of predicted images over samples",
    "thesis-3.5": "Time samples: the same in all pixels, one set per pixel, even noise",
    "thesis-3.6": "Pixels as moving triangles, before and after correction",
    "thesis-3.8": "Images from points on the lens, and their mean",
    "thesis-3.9": "Point and line samples on the lens",
    "thesis-4.1": "Nodes visited by rays, before and after optimising the tree",
    "thesis-4.1.3": "Tree builders beside the surface area heuristic",
    "thesis-4.2": "Two-means clusters and their bounding boxes",
    "thesis-4.3.1": "Four kinds of trees over moving triangles",
    "thesis-table-4.1": "Binary trees over m leaves, enumerated",
    "thesis-table-4.2": "Trees before and after optimising their subtrees",
    "thesis-table-4.3": "Optimising the upper levels, or the whole tree",
    "thesis-3.11": "Depth of field by line samples on the lens",
    "thesis-5.2": "Elementary intervals, and a net",
    "thesis-5.3": "Blocks of the Sobol' (0,2)-sequence",
    "thesis-5.4": "Initial direction numbers of the Sobol' sequence",
    "thesis-5.5": "Minimum distances of (0,m,3)-nets",
    "thesis-5.7": "Matrices of (0,2)-sequences and their points",
    "thesis-5.9": "(0,m,3)-nets from searched matrices",
    "thesis-5.11": "Padded replications: one net, shifted and jittered",
    "thesis-5.12": "Frames of the Sobol' sequence",
    "thesis-5.14": "Iterative construction of permutation nets of odd m",
    "thesis-5.15": "Cases of the proof for permutation nets, m = 5",
    "thesis-5.16": "Permutation nets",
    "thesis-5.17": "Iterative construction of permutation nets of even m",
    "thesis-5.20": "The sheared tiling of a net",
    "thesis-5.21": "Minimum distances of (0,m,2)-nets",
    "thesis-5.22": "Power spectra of nets",
    "thesis-5.23": "Owen scramblings of a permutation net",
    "thesis-5.3.2": "Permutation nets in three dimensions, P_2 to P_5",
    "thesis-6.1": "The checkerboard at 64 samples per pixel",
    "thesis-6.2": "Convergence on the checkerboard",
    "thesis-6.3": "The zone plate at 64 samples per pixel",
    "thesis-6.4": "Convergence on the zone plate",
    "thesis-6.5": "The Cornell box at 64 samples per pixel",
    "thesis-6.6": "Convergence on the Cornell box",
    "thesis-6.7": "The helicopter at 64 samples per pixel",
    "thesis-6.8": "Convergence on the helicopter",
    "benchmark": "Error over run time, by sampler and beside other programs",
    "spp-slider": "One scene with eight samplers, from 1 to 256 samples per pixel",
    "screen-space": "All screen-space methods, from 1 to 64 samples per pixel",
    "designed-samplers": "Designed tiles beside other samplers, in animations, and for scenes",
    "discrepancy-records": "Certified discrepancies of searched sets, beside published ones",
    "intervals": "Coverage of confidence intervals, and samplers distinguished",
    "mitsuba-samplers": "Our samplers in Mitsuba 3, beside its own",
    "skipping": "Constant pixels need no samples",
    "speed": "How fast points, rays, paths and measures are, beside other programs",
    "scale": "Time and memory of larger images and of measures of more points",
    "stability": "Float32 limits of points, sums and ray tracing",
    "hilbert-1": "Space-filling curves and their segments in a 3x3 neighbourhood",
    "hilbert-2": "Differences of positions between neighbouring pixels",
    "hilbert-3": "Radical inverses along the curves",
    "hilbert-4": "Scrambled radical inverses along the curves",
    "hilbert-5": "An interior along the Hilbert curve",
    "z-1": "An interior at one sample per pixel, and spectra of its error",
    "z-2": "The Morton order of 8 x 8 pixels",
    "z-3": "A soft shadow at one sample per pixel, along the Morton order or not",
    "z-4": "The accordion order, unfolded cut by cut",
    "z-5": "The permutations of a scrambled Morton order",
    "z-6": "The samples of 128 x 128 pixels and their star discrepancies",
    "z-7": "The letters of a self-similar tree, at the nodes of permutations",
    "z-8": "Dimension 5 of the global Sobol' sequence",
    "z-9": "A complex occluder and three coloured lights, by four samplers",
    "z-10": "Motion blur, a lens, paths and a caustic, by four samplers",
    "z-11": "Convergence on rendered scenes",
    "z-12": "Variants of the Z-sampler and sizes of its alphabet",
    "z-table-1": "Run times of images by sampler, Table 1",
}
"""What figures are called below their names."""

OUR_SCENE = frozenset(
    """
    thesis-3.1.5 thesis-3.2.1 thesis-3.3 thesis-3.3.4 thesis-3.5 thesis-3.6 thesis-3.8 thesis-4.1
    thesis-table-4.2 thesis-table-4.3 thesis-3.11 thesis-6.5 thesis-6.6 thesis-6.7 thesis-6.8
    hilbert-5 z-1 z-3 z-9 z-10 z-11 z-12 z-table-1
    """.split()
)
"""Those of a scene that stands in for the paper's own, which is not to be had."""

TIMED = frozenset(
    """
    thesis-3.2.1 thesis-table-4.2 thesis-table-4.3 thesis-3.11 benchmark designed-samplers
    mitsuba-samplers skipping speed scale thesis-4.1.3 z-table-1
    """.split()
)
"""Those that measure time: in paper quality nothing runs beside them."""

LONG = frozenset("thesis-6.8 intervals hilbert-5 z-11 z-12".split())
"""Among the longest in paper quality: begun first, they are not what the rest waits for."""


MODULES = {
    "hilbert.radical_inverses": "hilbert-3 hilbert-4",
    "thesis.chapter_2.linear_segments": "thesis-2.4 thesis-2.5 thesis-2.7 thesis-2.8",
    "thesis.chapter_2.rotation_bounds": "thesis-2.6",
    "thesis.chapter_2.spline_curves": "thesis-2.1 thesis-2.2 thesis-2.3",
    "thesis.chapter_3.lens_lines": "thesis-3.11",
    "thesis.chapter_3.lens_samples": "thesis-3.8 thesis-3.9",
    "thesis.chapter_3.moving_triangle": "thesis-3.1",
    "thesis.chapter_3.photons": "thesis-3.1.5",
    "thesis.chapter_3.prediction": "thesis-3.3 thesis-3.6",
    "thesis.chapter_3.prediction_error": "thesis-3.3.4",
    "thesis.chapter_3.sliding_window": "thesis-3.1.3",
    "thesis.chapter_3.times_of_pixels": "thesis-3.1.7 thesis-3.5",
    "thesis.chapter_3.visibility_in_time": "thesis-3.2.1",
    "thesis.chapter_3.visible_segments": "thesis-3.2",
    "thesis.chapter_4.builders": "thesis-4.1.3",
    "thesis.chapter_4.counted_trees": "thesis-table-4.1",
    "thesis.chapter_4.moving_trees": "thesis-4.3.1",
    "thesis.chapter_4.optimised_trees": "thesis-table-4.2 thesis-table-4.3",
    "thesis.chapter_4.tree_pictures": "thesis-4.1 thesis-4.2",
    "thesis.chapter_5.direction_numbers": "thesis-5.4",
    "thesis.chapter_5.distances": "thesis-5.21 thesis-5.22",
    "thesis.chapter_5.frames": "thesis-5.11 thesis-5.12",
    "thesis.chapter_5.matrices": "thesis-5.5 thesis-5.7 thesis-5.9",
    "thesis.chapter_5.nets": "thesis-5.2 thesis-5.3 thesis-5.3.2 thesis-5.16 thesis-5.20 thesis-5.23",
    "thesis.chapter_5.permutation_nets": "thesis-5.14 thesis-5.15 thesis-5.17",
    "thesis.chapter_6.moving_scenes": "thesis-6.5 thesis-6.6 thesis-6.7 thesis-6.8",
    "thesis.chapter_6.plane_scenes": "thesis-6.1 thesis-6.2 thesis-6.3 thesis-6.4",
    "z.nodes": "z-5 z-7",
    "z.rendered_scenes": "z-9 z-10",
}
"""Modules not called as their figure, and what they make: of several, each by the function of its name."""


def _module(name: str) -> str:
    """Return the module that makes a figure, in the package of its paper or of our own, and its function."""
    paper, function = name.partition("-")[0], re.sub("[-.]", "_", name)
    for module, names in MODULES.items():
        if name in names.split():
            return f"figures.{module}" + (f":{function}" if " " in names else "")
    return f"figures.{paper if paper in PAPERS else 'ours'}.{function}"


CATALOGUE = {
    name: Entry(_module(name), title, name in OUR_SCENE, name in TIMED, name in LONG)
    for name, title in TITLES.items()
}

OURS = frozenset(name for name in CATALOGUE if name.partition("-")[0] not in PAPERS)

FIRST = (
    "thesis-6.1",
    "spp-slider",
    "hilbert-1",
    "thesis-6.5",
    "hilbert-5",
    "thesis-6.2",
    "z-3",
    "z-9",
    "z-1",
)
"""What a reader wants first: images, the slider of the page's first screen, and curves."""

LAST = ("thesis-3.3.4", "z-10", "thesis-6.8", "thesis-6.6", "z-12", "z-11")
"""Those that take longest; their scenes are then compiled."""

NO_DRAFT = {
    "mitsuba-samplers": "it has one scene, and needs Mitsuba 3",
    "scale": "it has two points per line",
    "speed": "its calls are too small to be timed",
    "thesis-3.2.1": "it times one scene, for milliseconds",
    "z-table-1": "it has two counts of fourteen, in milliseconds",
}
"""Figures that show nothing at the size of a draft, and why: paper quality makes them."""
