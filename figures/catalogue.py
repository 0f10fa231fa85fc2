"""The figures behind the command line: the project's only registry, read without importing any figure."""

from typing import NamedTuple


class Entry(NamedTuple):
    module: str
    title: str
    our_scene: bool = False
    """Whether the scene stands in for the paper's own, which is not to be had."""
    timed: bool = False
    """Whether it measures time: in paper quality nothing runs beside it."""
    long: bool = False
    """Whether it is among the longest in paper quality: begun first, it is not what the rest waits for."""


CATALOGUE = {
    "thesis-2.1": Entry("figures.thesis.thesis_2_1", "Cubic B-spline basis functions"),
    "thesis-2.2": Entry("figures.thesis.thesis_2_2", "Equal steps in parameter and in arc length"),
    "thesis-2.3": Entry("figures.thesis.thesis_2_3", "A knot of full multiplicity"),
    "thesis-2.4": Entry("figures.thesis.thesis_2_4", "Arc length by linear segments"),
    "thesis-2.5": Entry("figures.thesis.thesis_2_5", "A curve in segments of equal length"),
    "thesis-2.6": Entry("figures.thesis.thesis_2_6", "Bounds of a rotating rectangle"),
    "thesis-2.7": Entry("figures.thesis.thesis_2_7", "A fast rotation approximated by linear segments"),
    "thesis-2.8": Entry("figures.thesis.thesis_2_8", "A jumping ball approximated by linear segments"),
    "thesis-3.1.3": Entry("figures.thesis.thesis_3_1_3", "Sliding-window motion blur and moving lines"),
    "thesis-3.1.5": Entry(
        "figures.thesis.thesis_3_1_5", "Photons at one time each, and over intervals of time", our_scene=True
    ),
    "thesis-3.1.7": Entry("figures.thesis.thesis_3_1_7", "Frameless rendering: pixels in the order of a net"),
    "thesis-3.1": Entry("figures.thesis.thesis_3_1", "When a ray hits a moving triangle"),
    "thesis-3.2": Entry("figures.thesis.thesis_3_2", "Visibility along a ray while the shutter is open"),
    "thesis-3.2.1": Entry(
        "figures.thesis.thesis_3_2_1",
        "Analytic and sampled visibility in time, at equal run time",
        our_scene=True,
        timed=True,
    ),
    "thesis-3.3": Entry(
        "figures.thesis.thesis_3_3",
        "Images predicted in the middle of the shutter",
        our_scene=True,
    ),
    "thesis-3.3.4": Entry(
        "figures.thesis.thesis_3_3_4", "Error and bias of predicted images over samples", our_scene=True
    ),
    "thesis-3.5": Entry(
        "figures.thesis.thesis_3_5",
        "Time samples: the same in all pixels, one set per pixel, even noise",
        our_scene=True,
    ),
    "thesis-3.6": Entry(
        "figures.thesis.thesis_3_6",
        "Pixels as moving triangles, before and after correction",
        our_scene=True,
    ),
    "thesis-3.8": Entry(
        "figures.thesis.thesis_3_8", "Images from points on the lens, and their mean", our_scene=True
    ),
    "thesis-3.9": Entry("figures.thesis.thesis_3_9", "Point and line samples on the lens"),
    "thesis-4.1": Entry(
        "figures.thesis.thesis_4_1",
        "Nodes visited by rays, before and after optimising the tree",
        our_scene=True,
    ),
    "thesis-4.2": Entry("figures.thesis.thesis_4_2", "Two-means clusters and their bounding boxes"),
    "thesis-table-4.1": Entry("figures.thesis.thesis_table_4_1", "Binary trees over m leaves, enumerated"),
    "thesis-table-4.2": Entry(
        "figures.thesis.thesis_table_4_2",
        "Trees before and after optimising their subtrees",
        our_scene=True,
        timed=True,
    ),
    "thesis-table-4.3": Entry(
        "figures.thesis.thesis_table_4_3",
        "Optimising the upper levels, or the whole tree",
        our_scene=True,
        timed=True,
    ),
    "thesis-3.11": Entry(
        "figures.thesis.thesis_3_11", "Depth of field by line samples on the lens", our_scene=True, timed=True
    ),
    "thesis-5.2": Entry("figures.thesis.thesis_5_2", "Elementary intervals, and a net"),
    "thesis-5.3": Entry("figures.thesis.thesis_5_3", "Blocks of the Sobol' (0,2)-sequence"),
    "thesis-5.4": Entry("figures.thesis.thesis_5_4", "Initial direction numbers of the Sobol' sequence"),
    "thesis-5.5": Entry("figures.thesis.thesis_5_5", "Minimum distances of (0,m,3)-nets"),
    "thesis-5.7": Entry("figures.thesis.thesis_5_7", "Matrices of (0,2)-sequences and their points"),
    "thesis-5.9": Entry("figures.thesis.thesis_5_9", "(0,m,3)-nets from searched matrices"),
    "thesis-5.11": Entry("figures.thesis.thesis_5_11", "Padded replications: one net, shifted and jittered"),
    "thesis-5.12": Entry("figures.thesis.thesis_5_12", "Frames of the Sobol' sequence"),
    "thesis-5.14": Entry("figures.thesis.thesis_5_14", "Iterative construction of permutation nets of odd m"),
    "thesis-5.15": Entry("figures.thesis.thesis_5_15", "Cases of the proof for permutation nets, m = 5"),
    "thesis-5.16": Entry("figures.thesis.thesis_5_16", "Permutation nets"),
    "thesis-5.17": Entry(
        "figures.thesis.thesis_5_17", "Iterative construction of permutation nets of even m"
    ),
    "thesis-5.20": Entry("figures.thesis.thesis_5_20", "The sheared tiling of a net"),
    "thesis-5.21": Entry("figures.thesis.thesis_5_21", "Minimum distances of (0,m,2)-nets"),
    "thesis-5.22": Entry("figures.thesis.thesis_5_22", "Power spectra of nets"),
    "thesis-5.23": Entry("figures.thesis.thesis_5_23", "Owen scramblings of a permutation net"),
    "thesis-5.3.2": Entry("figures.thesis.thesis_5_3_2", "Permutation nets in three dimensions, P_2 to P_5"),
    "thesis-6.1": Entry("figures.thesis.thesis_6_1", "The checkerboard at 64 samples per pixel"),
    "thesis-6.2": Entry("figures.thesis.thesis_6_2", "Convergence on the checkerboard"),
    "thesis-6.3": Entry("figures.thesis.thesis_6_3", "The zone plate at 64 samples per pixel"),
    "thesis-6.4": Entry("figures.thesis.thesis_6_4", "Convergence on the zone plate"),
    "thesis-6.5": Entry(
        "figures.thesis.thesis_6_5", "The Cornell box at 64 samples per pixel", our_scene=True
    ),
    "thesis-6.6": Entry("figures.thesis.thesis_6_6", "Convergence on the Cornell box", our_scene=True),
    "thesis-6.7": Entry(
        "figures.thesis.thesis_6_7", "The helicopter at 64 samples per pixel", our_scene=True
    ),
    "thesis-6.8": Entry(
        "figures.thesis.thesis_6_8", "Convergence on the helicopter", our_scene=True, long=True
    ),
    "benchmark": Entry(
        "figures.ours.benchmark", "Error over run time, by sampler and beside other programs", timed=True
    ),
    "rivals": Entry("figures.ours.rivals", "Samplers of other projects by their own code, in the suite"),
    "chooser": Entry("figures.ours.chooser", "Which sampler to choose, by scene and samples per pixel"),
    "spp-slider": Entry(
        "figures.ours.spp_slider", "One scene with eight samplers, from 1 to 256 samples per pixel"
    ),
    "screen-space": Entry(
        "figures.ours.screen_space", "All screen-space methods, from 1 to 64 samples per pixel"
    ),
    "designed-samplers": Entry(
        "figures.ours.designed_samplers", "Tiles designed by gradients beside other samplers", timed=True
    ),
    "designed-for-scenes": Entry(
        "figures.ours.designed_for_scenes", "Points designed for one scene, by its camera and by others"
    ),
    "space-time": Entry(
        "figures.ours.space_time", "Samplers of animations: errors after filters in space and time", long=True
    ),
    "optimized-orders": Entry(
        "figures.ours.optimized_orders",
        "Optimised orders beside the samplers of the papers",
        timed=True,
    ),
    "progressive": Entry(
        "figures.ours.progressive",
        "One sampler for any number of samples beside samplers made for each",
        timed=True,
    ),
    "joint-orders": Entry(
        "figures.ours.joint_orders", "Orders optimised for four and eight coordinates together"
    ),
    "discrepancy-records": Entry(
        "figures.ours.discrepancy_records", "Certified discrepancies of searched sets, beside published ones"
    ),
    "generators": Entry(
        "figures.ours.generators", "Generators of points: t, projections, discrepancy, convergence"
    ),
    "four-dimensions": Entry(
        "figures.ours.four_dimensions", "Sequences in four dimensions: which can exist, and their errors"
    ),
    "measures": Entry("figures.ours.measures", "Every measure of every sequence"),
    "intervals": Entry(
        "figures.ours.intervals", "Coverage of confidence intervals, and samplers distinguished", long=True
    ),
    "mitsuba-samplers": Entry(
        "figures.ours.mitsuba_samplers", "Our samplers in Mitsuba 3, beside its own", timed=True
    ),
    "skipping": Entry("figures.ours.skipping", "Constant pixels need no samples", timed=True),
    "speed": Entry(
        "figures.ours.speed",
        "How fast points, rays, paths and measures are, beside other programs",
        timed=True,
    ),
    "source": Entry(
        "figures.ours.source",
        "Samplers as C source code beside XLA, plain Python and OpenQMC: nanoseconds per coordinate",
        timed=True,
    ),
    "scale": Entry(
        "figures.ours.scale", "Time and memory of larger images and of measures of more points", timed=True
    ),
    "stability": Entry("figures.ours.stability", "Float32 limits of points, sums and ray tracing"),
    "tree-builders": Entry(
        "figures.ours.tree_builders", "Tree builders beside the surface area heuristic", timed=True
    ),
    "trees-in-motion": Entry("figures.ours.trees_in_motion", "Four kinds of trees over moving triangles"),
    "scenes-sheet": Entry("figures.ours.scenes_sheet", "Every scene with its exact image"),
    "hilbert-1": Entry(
        "figures.hilbert.hilbert_1", "Space-filling curves and their segments in a 3x3 neighbourhood"
    ),
    "hilbert-2": Entry("figures.hilbert.hilbert_2", "Differences of positions between neighbouring pixels"),
    "hilbert-3": Entry("figures.hilbert.hilbert_3", "Radical inverses along the curves"),
    "hilbert-4": Entry("figures.hilbert.hilbert_4", "Scrambled radical inverses along the curves"),
    "hilbert-5": Entry(
        "figures.hilbert.hilbert_5", "An interior along the Hilbert curve", our_scene=True, long=True
    ),
    "z-1": Entry(
        "figures.z.z_1", "An interior at one sample per pixel, and spectra of its error", our_scene=True
    ),
    "z-2": Entry("figures.z.z_2", "The Morton order of 8 x 8 pixels"),
    "z-3": Entry(
        "figures.z.z_3",
        "A soft shadow at one sample per pixel, along the Morton order or not",
        our_scene=True,
    ),
    "z-4": Entry("figures.z.z_4", "The accordion order, unfolded cut by cut"),
    "z-5": Entry("figures.z.z_5", "The permutations of a scrambled Morton order"),
    "z-6": Entry("figures.z.z_6", "The samples of 128 x 128 pixels and their star discrepancies"),
    "z-7": Entry("figures.z.z_7", "The letters of a self-similar tree, at the nodes of permutations"),
    "z-8": Entry("figures.z.z_8", "Dimension 5 of the global Sobol' sequence"),
    "z-9": Entry(
        "figures.z.z_9", "A complex occluder and three coloured lights, by four samplers", our_scene=True
    ),
    "z-10": Entry(
        "figures.z.z_10", "Motion blur, a lens, paths and a caustic, by four samplers", our_scene=True
    ),
    "z-11": Entry("figures.z.z_11", "Convergence on rendered scenes", our_scene=True, long=True),
    "z-12": Entry(
        "figures.z.z_12", "Variants of the Z-sampler and sizes of its alphabet", our_scene=True, long=True
    ),
    "z-table-1": Entry(
        "figures.z.z_table_1", "Run times of images by sampler, Table 1", our_scene=True, timed=True
    ),
}

PAPERS = {
    "hilbert": "Rendering along the Hilbert curve",
    "z": "The Z-sampler",
    "thesis": "Motion blur, the thesis",
}
"""The papers, by what the names of their figures begin with."""

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
    "four-dimensions": "it has three points per line, and all of the searches",
    "generators": "it has two points per line",
    "mitsuba-samplers": "it has one scene, and needs Mitsuba 3",
    "scale": "it has two points per line",
    "source": "its images are too small to be timed",
    "speed": "its calls are too small to be timed",
    "thesis-3.2.1": "it times one scene, for milliseconds",
    "z-table-1": "it has three counts of fourteen, in milliseconds",
}
"""Figures that show nothing at the size of a draft, and why: paper quality makes them."""
