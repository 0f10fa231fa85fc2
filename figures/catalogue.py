"""The figures behind the command line: the project's only registry, read without importing any figure."""

import re
from typing import NamedTuple


class Entry(NamedTuple):
    """A figure; `OUR_SCENE`, `TIMED` and `LONG` explain its flags."""

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
    "thesis-2.1": "At most four cubic B-spline basis functions differ from zero at once",
    "thesis-2.2": "Equal steps of the parameter are unequal steps along the curve",
    "thesis-2.3": "A knot of full multiplicity pulls the curve through a control point, with a corner",
    "thesis-2.3.1": "Matrices blended by component shrink objects; a corner makes quadrature cost more",
    "thesis-2.4": "Linear segments approximate the arc length, even of a curve with a corner",
    "thesis-2.5": "Ends of segments lie on the curve, and errors in between stay below their bound",
    "thesis-2.6": "Corners are farthest out where the derivative is zero, or at the end",
    "thesis-2.7": "A fast rotation needs more than 20 linear segments per turn for an error of 1 %",
    "thesis-2.8": "The ball touches the floor only if segments end where it lands",
    "thesis-3.1.3": "A ring buffer makes each motion-blurred frame from one new image",
    "thesis-3.1.5": "Photons stored for intervals of time: less than half as many give the same error",
    "thesis-3.1.6": "Lightcuts evaluate less than 2 % of all pairs, with no error above its bound",
    "thesis-3.1.7": "Frameless rendering in the order of a net leaves smaller gaps than at random",
    "thesis-3.1.8": "Interpolated frames show smoke twice, on any grid; advection moves it",
    "thesis-3.1": "A ray hits a moving triangle from one crossing of an edge to the next",
    "thesis-3.2": "What a ray sees changes far less often than the worst case of m^2",
    "thesis-3.2.1": "At equal time, analytic visibility in time gains in three of seven settings",
    "thesis-3.3": "Prediction has less than half the error of blending where things move",
    "thesis-3.3.1": "Each approximation of motion blur is close in some scenes and fails in others",
    "thesis-3.3.4": "Predicted images have less error than plain ones, but are biased",
    "thesis-3.5": "Separate times in each pixel more than halve the filtered error of shared ones",
    "thesis-3.6": "Checking the contrast finds the pixels whose prediction fails",
    "thesis-3.8": "The mean of images from points on the lens approaches depth of field",
    "thesis-3.9": "A square-root mapping spreads samples on diameters evenly over the lens",
    "thesis-4.1": "Optimised trees save rays most nodes in the tessellated rooms, few elsewhere",
    "thesis-4.1.3": "Trees by 2-means or along curves are worse than by the surface area heuristic",
    "thesis-4.2": "Boxes of 2-means clusters overlap far more than those of the surface area heuristic",
    "thesis-4.3.1": "Trees that follow the motion need fewer nodes than boxes for the whole shutter",
    "thesis-4.3.2": "Ray classification needs fewer tests than trees only if very many rays share candidates",
    "thesis-table-4.1": "Enumeration confirms the printed numbers of binary trees",
    "thesis-table-4.2": "Optimising subtrees in place never increases the summed area",
    "thesis-table-4.3": "Further runs of the optimisation gain less than the first one",
    "thesis-3.11": "Each doubling of the lines on the lens, up to 16, lowers the error",
    "thesis-5.2": "A net has exactly one point in each elementary interval",
    "thesis-5.3": "Blocks of the Sobol' (0,2)-sequence are nets, and so is their union",
    "thesis-5.4": "Joe and Kuo's direction numbers halve the filtered error along a Hilbert curve",
    "thesis-5.5": "The modified net's minimum distance shrinks more smoothly than the Sobol' net's",
    "thesis-5.7": "A search finds matrices of larger distance than those with a pattern",
    "thesis-5.9": "Matrices searched for m = 13 have larger distances there, smaller ones at m = 4 to 11",
    "thesis-5.11": "Shifts keep the minimum distance of a net, but not its elementary intervals",
    "thesis-5.12": "Frames of the Sobol' sequence are nets, superimposed a larger net",
    "thesis-5.14": "The iterative construction gives a (0,9,2)-net of squared distance 512",
    "thesis-5.15": "The theorem on permutation nets holds, two of its printed formulas do not",
    "thesis-5.16": "Permutation nets have the squared distances that are printed",
    "thesis-5.17": "The iterative construction gives a (0,8,2)-net of squared distance 241",
    "thesis-5.20": "A sheared tiling repeats a net without reducing its minimum distance",
    "thesis-5.21": "Of all nets compared, permutation nets have the largest minimum distance",
    "thesis-5.22": "Peaks in the spectra of permutation nets are almost as high as a lattice's",
    "thesis-5.23": "Owen scrambling keeps the net but not its distance, a rotation the reverse",
    "thesis-5.3.2": "Permutation nets in three dimensions have the printed distances",
    "thesis-6.1": "Checkerboard at 64 samples per pixel: the rotated lattice leaves a line",
    "thesis-6.2": "Checkerboard: Larcher-Pillichshammer is best at most sample counts",
    "thesis-6.3": "Zone plate at 64 samples per pixel: noise of the jittered grid hides fine rings",
    "thesis-6.4": "Zone plate: in places nets and lattices are worse than the jittered grid",
    "thesis-6.5": "Cornell box: rotated nets have less error than random points and the lattice",
    "thesis-6.6": "Cornell box: from 4 samples per pixel on, nets and lattices beat random samples",
    "thesis-6.7": "Helicopter: full-screen Sobol' nets have the least error",
    "thesis-6.8": "Helicopter: from 4 samples per pixel on, nets beat random samples",
    "benchmark": "Random samples take 4 to 7 times as long as the fastest sampler for an equal error",
    "spp-slider": "One scene with several samplers, from 1 to 256 samples per pixel",
    "screen-space": "Blocks of one sequence along a curve keep errors out of low frequencies",
    "designed-samplers": "Designed tiles beside other samplers, in animations, and for scenes",
    "denoisers": "After a denoiser, regular errors can be the largest: it keeps them as a texture",
    "discrepancy-records": "Searched points have about half of Sobol's star discrepancy, and less in L2",
    "intervals": "Betting intervals held every integral; others are narrower, and miss some",
    "smooth": "For smooth integrands lattices with a tent beat Sobol' points, interlaced nets in 3-D only",
    "edges": "Lines see edges: their derivatives lead from a wrong pose to the target",
    "playground": "The page renders two samplers side by side, by shaders",
    "speed": "Points and measures are faster than other programs', rays and paths about as fast",
    "hilbert-1": "Of the four curves, none has fewer segments in its worst 3x3 neighbourhood than Hilbert's",
    "hilbert-2": "Many neighbours on the Hilbert curve differ by 3, a base of the Halton sequence",
    "hilbert-3": "Radical inverses leave regular structures along all four curves",
    "hilbert-4": "Scrambling leaves correlations along the curves: Morton's stripes stay",
    "hilbert-5": "Along the Hilbert curve the RMS error is mostly about that of the global sequence",
    "hilbert-cache": "Along the Hilbert curve a small cache of tree nodes misses less than in rows",
    "hilbert-halftone": "Halftones along the Hilbert curve have no preferred direction",
    "z-1": "At one sample per pixel the error of Z is blue noise, that of the (0,2)-sequence white",
    "z-2": "The Morton order interleaves the bits of row and column",
    "z-3": "The Morton order diffuses the error, scrambling removes its preferred directions",
    "z-4": "The accordion order keeps neighbours closer than the Morton order",
    "z-5": "21 permutations scramble the Morton order of 8 x 8 pixels",
    "z-6": "Z has less than a tenth of the discrepancy of xor-scrambled samples",
    "z-7": "Pixels below equal letters of the tree come in the same order",
    "z-8": "In dimension 5 of the global Sobol' sequence, blocks of pixels share one half",
    "z-9": "Complex occluder: the error of Z is blue noise, that of Sobol' aliases",
    "z-10": "Filtered errors of Z are within a fifth of the least, except for motion blur",
    "z-11": "Z and the (0,2)-sequence are alike in the interior; three scenes are too noisy to tell",
    "z-12": "Hashing and large tables are alike, a single letter hinders convergence",
    "z-splitting": "Splitting as one set has least filtered error in shadows, none is better for edges",
    "z-table-1": "From 4 samples per pixel on, the global Sobol' sequence is slower than Z",
}
"""What a reader learns from each figure, where a stored finding says it; else what is shown."""

OUR_SCENE = frozenset(
    """
    thesis-3.1.5 thesis-3.2.1 thesis-3.3 thesis-3.3.4 thesis-3.5 thesis-3.6 thesis-3.8 thesis-4.1
    thesis-table-4.2 thesis-table-4.3 thesis-3.11 thesis-6.5 thesis-6.6 thesis-6.7 thesis-6.8
    hilbert-5 hilbert-cache hilbert-halftone z-1 z-3 z-9 z-10 z-11 z-12 z-splitting z-table-1
    """.split()
)
"""Figures whose scene stands in for the paper's, which is not published."""

TIMED = frozenset(
    """
    thesis-3.2.1 thesis-table-4.2 thesis-table-4.3 thesis-3.11 thesis-5.4 benchmark designed-samplers
    edges speed z-table-1
    """.split()
)
"""Figures that measure time: in paper quality nothing runs beside them."""

LONG = frozenset("thesis-6.8 intervals hilbert-5 z-11 z-12".split())
"""Among the longest in paper quality: they start first, so that nothing waits for them."""


MODULES = {
    "hilbert.radical_inverses": "hilbert-3 hilbert-4",
    "thesis.chapter_2.linear_segments": "thesis-2.4 thesis-2.5 thesis-2.7 thesis-2.8",
    "thesis.chapter_2.matrices_and_lengths": "thesis-2.3.1",
    "thesis.chapter_2.rotation_bounds": "thesis-2.6",
    "thesis.chapter_2.spline_curves": "thesis-2.1 thesis-2.2 thesis-2.3",
    "thesis.chapter_3.approximations": "thesis-3.3.1",
    "thesis.chapter_3.eulerian": "thesis-3.1.8",
    "thesis.chapter_3.lens_lines": "thesis-3.11",
    "thesis.chapter_3.lens_samples": "thesis-3.8 thesis-3.9",
    "thesis.chapter_3.lightcuts": "thesis-3.1.6",
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
    "thesis.chapter_4.ray_classification": "thesis-4.3.2",
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
"""Modules not named after their figure, and their figures; of several, each has a function of its name."""


def _module(name: str) -> str:
    """Return the module and function that make a figure, in the package of its paper or of ours."""
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
"""Figures that readers want first: images, the slider of the page's first screen, and curves."""

LAST = ("thesis-3.3.4", "z-10", "thesis-6.8", "thesis-6.6", "z-12", "z-11")
"""Figures that take longest; by then their scenes are compiled."""

NO_DRAFT = {
    "speed": "its calls are too small to be timed",
    "thesis-3.2.1": "it times one scene, for milliseconds",
    "z-table-1": "it has two counts of fourteen, in milliseconds",
}
"""Figures that show nothing at draft size, and why: only paper quality makes them."""
