"""Sentences of the papers that no figure shows: small computations, and numbers that contradict others."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import analysis
import qmcjax as qj
from analysis import trees
from figures._errors import rms
from figures.shared import judged, meshes
from figures.shared.rendered import diffusion, scene_images
from figures.thesis.chapter_4 import moving_trees
from qmcjax import orders, samplers, scenes, sequences, tracing


def grid(side):
    """Return columns and rows of all pixels, uint32 (side, side)."""
    return jnp.asarray(np.mgrid[:side, :side].astype(np.uint32))[::-1]


def spectrum(image):
    """Return the power of an image without its mean, over the mean power: sorted, largest first."""
    power = np.abs(np.fft.fft2(image - image.mean())).ravel()[1:] ** 2
    return np.sort(power / power.mean())[::-1]


# Hilbert paper


def test_shifts_by_a_mask_change_what_a_filter_leaves_and_not_the_error():
    """Sect. 2: the product of two coordinates at 1 sample per pixel, over 8 placements or keys."""
    mask, lattice, exact = samplers.blue_noise_mask(), sequences.lattice(2), np.full((64, 64), 0.25)
    errors = {"mask": [], "random": []}
    for key in range(8):
        placed = np.roll(np.rot90(mask, key), 17 * key, axis=(0, 1))
        alone = samplers.independent(lattice, key, "shift")
        for name, sampler in {"mask": samplers.dither(placed, lattice), "random": alone}.items():
            image = np.asarray(sampler(*grid(64), jnp.uint32(0), dims=(0, 1))).prod(axis=-1)
            errors[name].append((rms(image - exact), analysis.filtered_error(image, exact)))
    ratio = np.mean(errors["mask"], axis=0) / np.mean(errors["random"], axis=0)
    assert ratio[0] == pytest.approx(1, abs=0.05) and ratio[1] < 0.3


def test_phi_3_is_correlated_where_indices_differ_by_3():
    """Sect. 3.1: so are all whose difference is a multiple of 3, which share the leading digit: stripes."""
    index = np.asarray(orders.hilbert(64, 64).position(*grid(64))).astype(np.int64)
    neighbours = (index[:, 1:], index[:, :-1]), (index[1:], index[:-1])
    pairs = np.concatenate([np.stack(pair, -1).reshape(-1, 2) for pair in neighbours])
    phi = np.asarray(sequences.van_der_corput(3).points(64**2)[:, 0], np.float64)[pairs]
    difference = np.abs(pairs[:, 0] - pairs[:, 1])
    first, second = phi[difference % 3 == 0].T
    assert np.array_equal(np.floor(3 * first), np.floor(3 * second))
    first, second = phi[difference == 3].T
    assert len(first) > 500
    assert np.corrcoef(first, second)[0, 1] > 0.8 and np.corrcoef(*phi[difference % 3 > 0].T)[0, 1] < 0


def test_iterations_take_multiples_of_the_curves_length():
    """Sect. 4.3: the length is an even power of the base of the curve."""
    for order, base, power in ((orders.hilbert(13, 16), 2, 8), (orders.peano(27, 20), 3, 6)):
        assert order.length == base**power
        sequence = sequences.uniform(2, key=1)
        sampler, j = samplers.segments(order, sequence, spp=4), int(order.position(7, 9))
        for k in range(3):
            index = jnp.arange(4, dtype=jnp.uint32) + np.uint32(4 * (k * order.length + j))
            sample = jnp.arange(4 * k, 4 * k + 4, dtype=jnp.uint32)
            points = sampler(jnp.uint32(7), jnp.uint32(9), sample, dims=(0, 1))
            assert np.array_equal(points, sequence(index))


@pytest.mark.slow
def test_permutations_improve_the_halton_sequence():
    """Sect. 3.1: Zaremba's permutation improves upon none, and Faure's upon Zaremba's; bases 17 and 19."""
    for n in (200, 500):
        points = [sequences.halton(8, way).points(n)[:, 6:] for way in ("faure", "zaremba", None)]
        found = [float(analysis.l2_star_discrepancy(each)) for each in points]
        assert found[0] < 0.5 * found[1] and found[1] < 0.95 * found[2]


@pytest.mark.slow
def test_shifted_lattices_of_random_vectors_err_as_the_global_sequence(tmp_path):
    """Sect. 3 and 4.1, the interior at 64 samples: by 16 odd vectors, all better than the one of Fig. 5."""
    side, spp, scene, halton = 64, 64, scenes.interior(2), sequences.halton(12, "faure_lemieux")
    kept, area = diffusion.find_kept(scene, side), diffusion.beside_window(side)

    def error(sampler):
        return rms((scene_images.replicate(scene, sampler, side, spp) - kept.image)[area])

    def shifted(vector):
        return error(samplers.shifted(orders.hilbert(side, side), halton, vector))

    errors = []
    for key in range(16):
        vector = 2 * np.random.default_rng(key).integers(0, 2**31, 12) + 1
        (tmp_path / "vector.txt").write_text("\n".join(map(str, vector)))
        errors.append(shifted(sequences.read_lattice(tmp_path / "vector.txt")))
    whole = error(samplers.full_screen(halton, side, side))
    assert judged.alike(errors, [whole] * 16, 1.1) is True
    assert max(errors) < shifted(sequences.lattice(12)) > 1.2 * whole


@pytest.mark.slow
def test_low_discrepancy_is_preserved_along_the_hilbert_curve():
    """Sect. 3: in two dimensions it is at most the root of that in one; along the raster it is near 1."""
    hilbert, raster = orders.hilbert(4096, 4096), orders.raster(4096, 4096)

    def along(order, fractions):
        place = jnp.asarray((fractions * 4**12).astype(np.uint32))
        points = np.stack([np.asarray(c, np.float64) + 0.5 for c in order.pixel(place)], axis=-1) / 4096
        return float(analysis.star_discrepancy(points))

    for n in (10, 50, 200, 800):
        fractions = np.asarray(sequences.van_der_corput(2).points(n)[:, 0], np.float64)
        rank = np.arange(n)
        on_line = max(np.max((rank + 1) / n - np.sort(fractions)), np.max(np.sort(fractions) - rank / n))
        assert on_line < along(hilbert, fractions) < np.sqrt(on_line)
        assert along(raster, fractions) > 0.9


def test_scrambling_the_index_suffices_along_the_morton_curve():
    """Sect. 3.1: the stripes of phi_2 stay if the values are scrambled, and go if the index is."""
    x, y = grid(32)
    phi = sequences.van_der_corput(2)
    scrambled = sequences.owen(phi, 3)
    plain, shuffled = orders.morton(32, 32), orders.scrambled_morton(32, 32, key=3)
    ways = {"none": (plain, phi), "values": (plain, scrambled), "index": (shuffled, phi)}
    upper = {k: np.asarray(seq(order.position(x, y))[..., 0]) >= 0.5 for k, (order, seq) in ways.items()}
    for name, expected in (("none", 32), ("values", 32), ("index", 0)):
        columns = upper[name].mean(axis=0)
        assert np.count_nonzero((columns == 0) | (columns == 1)) == expected, name
    blocks = upper["index"].reshape(16, 2, 16, 2).sum(axis=(1, 3))
    assert np.all(blocks == 2), "of each quadrant's four pixels, half are above 1/2"


@pytest.mark.slow
def test_repeated_randomisation_averages_out_artifacts():
    """Sect. 4.2: stripes and all fall with the root of the number of passes."""
    x, y = grid(16)
    order = orders.hilbert(16, 16)
    phi = sequences.van_der_corput(2)
    passes = samplers.randomized(lambda key: samplers.contiguous(order, sequences.owen(phi, key), 1), key=2)
    drawn = [passes.of_pass(k)(x, y, jnp.uint32(0), dims=(0,)) for k in range(128)]
    images = np.asarray(drawn)[..., 0]
    for image in images[:4]:
        assert spectrum(image)[:2].sum() > 20, "a checkerboard: white noise has 10 in its strongest waves"
    for count in (16, 128):
        error = images[:count].mean(axis=0) - 0.5
        assert np.sqrt(np.mean(error**2) * 12 * count) < 2


@pytest.mark.slow
@pytest.mark.parametrize("spp", [1, 4])
def test_correlated_samples_have_less_filtered_error_than_independent_ones(spp):
    """Sect. 6: x y, by blocks of one sequence along the curve and by a scrambling per pixel, 16 keys."""
    sobol, curve, errors = sequences.sobol(2), orders.hilbert(64, 64), []
    for key in range(16):
        along = samplers.contiguous(curve, sequences.owen(sobol, key), spp)
        for sampler in (along, samplers.independent(sobol, key)):
            image = analysis.pixel_means(lambda p: p[..., 0] * p[..., 1], sampler, 64, 64, spp, (0, 1))
            errors.append(analysis.filtered_error(np.asarray(image), np.full((64, 64), 0.25)))
    assert judged.smaller(errors[::2], errors[1::2], 0.8) is True


def test_long_integers_are_for_the_chinese_remainder_theorem_only():
    """Sect. 5, of 1920 x 1080 pixels, in 2**11 x 3**7: its products need more than 32 bits, the curve 22."""
    columns, rows = 2**11, 3**7
    multiples = rows * pow(rows, -1, columns), columns * pow(columns, -1, rows)
    column, row = 1919, 1079
    index = (column * multiples[0] + row * multiples[1]) % (columns * rows)
    assert (index % columns, index % rows) == (column, row)
    assert column * multiples[0] > 2**32
    order = orders.hilbert(1920, 1080)
    assert order.length == 4**11
    assert order.position(jnp.uint32(column), jnp.uint32(row)).dtype == jnp.uint32


def test_two_indices_of_32_bits_suffice_for_shifts():
    """Sect. 5: one along the curve and one of the sample, though together they count 2**64."""
    order, shifts, lattice = orders.hilbert(65536, 65536), sequences.halton(2), sequences.lattice(2)
    sampler = samplers.shifted(order, shifts, lattice)
    x, y, sample = (jnp.asarray(np.array(n, np.uint32)) for n in ([0, 65535], [65535, 0], [2**32 - 1, 2**31]))
    position = order.position(x, y)
    assert int(position.max()) == 2**32 - 1
    parts = lattice(sample, dtype=jnp.float64), shifts(position, dtype=jnp.float64)
    exact = np.asarray(parts, np.float64).sum(axis=0) % 1
    assert np.asarray(sampler(x, y, sample, dims=(0, 1))) == pytest.approx(exact, abs=1e-6)


def test_indices_along_the_hilbert_curve_need_neither_tables_nor_memory():
    """Sect. 5: the program has no arrays and looks nothing up, for any size of the image."""
    for side in (64, 4096):
        order = orders.hilbert(side, side)
        assert jax.tree.leaves(order) == []
        program = jax.make_jaxpr(order.position)(*(jnp.zeros(4, jnp.uint32),) * 2)
        assert all(np.size(constant) == 1 for constant in program.consts)
        assert "gather" not in str(program) and "dynamic_slice" not in str(program)


# Z paper


@pytest.mark.parametrize("seq", [sequences.lattice(4), sequences.sobol(4)], ids=["lattice", "Sobol'"])
def test_equal_samples_in_all_pixels_have_positively_correlated_errors(seq):
    """Sect. 1, and thesis, Sect. 6.2: so are visible after a filter, and from afar. Rotated ones are not."""
    scene, side, found = scenes.soft_shadow(), 64, {}
    exact, _ = scene.reference(side, side)
    for name, sampler in {
        "equal": samplers.dither(np.zeros((1, 1)), seq),
        "rotated": samplers.independent(seq, 1, "shift"),
    }.items():
        image = np.asarray(qj.render(scene, sampler, side, side, 4))
        error = image - exact
        alike = np.corrcoef(error[:, 1:].ravel(), error[:, :-1].ravel())[0, 1]
        afar = analysis.perceived_error(image, exact, distance=16000)
        found[name] = alike, analysis.filtered_error(image, exact), afar
    assert abs(found["rotated"][0]) < 0.1 and found["equal"][0] > 0.5
    assert min(np.divide(found["equal"], found["rotated"])[1:]) > 2


def errors(sampler, dims, side=64):
    """Return the errors of the product of coordinates that no pixel's position has, at one sample."""
    points = np.asarray(sampler(*grid(side), jnp.uint32(0), dims=tuple(range(2, 2 + dims))))
    return (2 * points).prod(axis=-1) - 1


def global_sobol(side=64):
    return samplers.full_screen(sequences.sobol(14), side, side)


@pytest.mark.slow
def test_darker_spectra_of_global_sobol_have_as_much_power():
    """Fig. 1: they appear darker, by the median, since the same energy is in spikes."""
    ours = samplers.independent(sequences.sobol(14), 1, "xor")
    for dims in (2, 4):
        spikes, white = errors(global_sobol(), dims), errors(ours, dims)
        assert np.mean(spikes**2) == pytest.approx(np.mean(white**2), rel=0.15)
        assert np.median(spectrum(spikes)) < 0.3 < 0.6 < np.median(spectrum(white))
        assert spectrum(spikes)[:40].sum() > 3 * spectrum(white)[:40].sum()


@pytest.mark.slow
def test_aliasing_is_more_evident_in_few_dimensions():
    """Sect. 5.1, of simple integrators: the share of the strongest 1 % falls with the dimension."""
    shares = [spectrum(errors(global_sobol(), dims))[:40].sum() / 4095 for dims in (2, 4, 8, 12)]
    assert shares[0] > 1.3 * shares[1] > 1.3**2 * shares[2] > 1.3**2 * shares[3]


@pytest.mark.slow
def test_aliasing_is_as_evident_with_simple_integrators():
    """Sect. 5.1: by direct light, and by paths of one and four bounces, in the Cornell box; 16 keys."""
    box = scenes.cornell_box(0.0, ball=False, mirror=False, blocks=True, light=0.5).estimator
    shares = []
    for scene in (box, *(tracing.path_tracing(box.world, box.camera, bounces) for bounces in (1, 4))):
        sobol = sequences.sobol(len(scene.needs))
        keyed = [samplers.full_screen(sequences.digital_shift(sobol, key), 64, 64) for key in range(16)]
        exact = scene_images.image(scene, samplers.independent(sobol, 99), 64, 256)
        errors = (scene_images.of_keys(scene, keyed, 64, 1) - exact).mean(axis=-1)
        shares.append([spectrum(error)[:40].sum() / 4095 for error in errors])
    assert judged.below(-np.array(shares[0]), -1.4 * 0.05) is True, "of white noise 1/20 are in 1 %"
    assert all(judged.alike(shares[0], others, 1.05) is True for others in shares[1:])


def test_other_sequences_are_diffused_along_the_scrambled_order():
    """Sect. 2: Halton points, a Weyl sequence and progressive multi-jittered samples."""
    side, exact = 64, np.full((64, 64), 0.25)
    order = orders.scrambled_morton(side, side, key=1)
    weyl, jittered = sequences.kronecker([0.618034, 0.414214]), sequences.pmj02(side**2, key=1)
    for sequence in (sequences.sobol(2), sequences.halton(2), weyl, jittered):
        points = samplers.contiguous(order, sequence, 1)(*grid(side), jnp.uint32(0), dims=(0, 1))
        assert analysis.low_frequency_power(np.asarray(points).prod(axis=-1), exact) < 0.25, sequence


def test_without_orders_of_samples_pairs_of_dimensions_are_correlated():
    """Sect. 4.4: if scrambling ends at the pixel, whose 16 samples keep their order in all pairs."""
    side, spp = 32, 16
    x, y = (each[..., None] for each in grid(side))
    sample = jnp.arange(spp, dtype=jnp.uint32)
    whole = np.asarray(samplers.z(side, side, spp, key=1, dims=4)(x, y, sample, dims=(0, 2)))
    curves = [orders.scrambled_morton(side, side, key=key) for key in (1, 2)]
    pixels = [samplers.contiguous(curve, sequences.sobol(2), spp) for curve in curves]
    parts = np.concatenate([np.asarray(each(x, y, sample, dims=(0,))) for each in pixels], -1)
    errors = [np.sqrt(np.mean((points - 0.5).prod(-1).mean(-1) ** 2)) for points in (whole, parts)]
    assert errors[1] > 3 * errors[0], errors


def test_the_printed_hash_repeats_itself_in_dimension_d_plus_3():
    """Eq. 8 is to differ between dimensions; three dimensions on, neighbouring nodes are swapped."""
    node = np.arange(2**16, dtype=np.uint64)

    def digits(i, dim):
        return ((i ^ np.uint64(0x55555555 * dim % 2**32)) * np.uint64(0x9E3779B9) % 2**32) * 24 >> 32

    for dim in range(1, 100):
        reverse = np.uint64(2 * (dim & -dim) - 1)
        assert np.array_equal(digits(node, dim), digits(node ^ reverse, dim + 3))


# Thesis


def test_refitted_trees_suit_motions_that_keep_their_hierarchy():
    """Sect. 4.2.2: quality depends on the kind of motion; it degrades after a few steps of a random one."""
    rng = np.random.default_rng(1)
    centre = rng.random((512, 3))
    turn, paths = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]), rng.normal(size=(512, 3))
    tree = trees.surface_area_tree(centre - 0.01, centre + 0.01)

    def degraded(moved):
        box = moved - 0.01, moved + 0.01
        refitted, anew = trees.refitted(tree, *box), trees.surface_area_tree(*box)
        return trees.summed_area(refitted) / trees.summed_area(anew)

    assert degraded(3 * centre + 1) == pytest.approx(1, abs=0.01) and degraded(centre @ turn) < 1.3
    random = [degraded(centre + 0.02 * step * paths) for step in range(0, 9, 2)]
    assert random == sorted(random) and random[0] == pytest.approx(1) and random[1] < 1.5 < 2 < random[-1]


def test_a_shift_by_any_offset_moves_points_between_pixels():
    """Sect. 5.2.5: then some pixels have none; after a shift by whole pixels each has one."""
    net = np.asarray(sequences.larcher_pillichshammer_net(8).points(256), np.float64)
    for offset, full in (((5 / 16, 11 / 16), True), ((0.333, 0.71), False)):
        cells = np.floor((net + offset) % 1 * 16).astype(int)
        assert (len(np.unique(cells @ [1, 16])) == 256) == full


@pytest.mark.slow
def test_property_a_holds_for_1111_dimensions():
    """Sect. 5.2.1: the leading digits of the direction numbers have minors of 1, by elimination in order."""
    chosen = sequences.direction_numbers(sequences.sobol(1111))
    assert _dims_of_property_a(chosen) == 1111
    assert _dims_of_property_a([(polynomial, [1] * len(initial)) for polynomial, initial in chosen]) == 5


def _dims_of_property_a(numbers):
    pivots = [1]  # the van der Corput sequence: only v_1 has the leading digit
    for dim, (polynomial, initial) in enumerate(numbers, start=1):
        degree = len(initial)
        digits = [m >> k & 1 for k, m in enumerate(initial)]
        taps = [i for i in range(1, degree + 1) if polynomial >> (degree - i) & 1]
        for k in range(degree, len(numbers) + 1):
            digits.append(sum(digits[k - i] for i in taps) % 2)
        row = sum(digit << k for k, digit in enumerate(digits))
        for k, pivot in enumerate(pivots):
            row ^= pivot * (row >> k & 1)
        if not row >> dim & 1:
            return dim
        pivots.append(row)
    return len(pivots)


def test_points_in_base_3_are_not_binary_numbers():
    """Sect. 5.2.2: none but 0 and no digit of it, even in float64."""
    points = np.asarray(sequences.faure(2, base=3).points(81, dtype=jnp.float64))
    assert all(Fraction(x) * 81 != round(x * 81) for x in points[points > 0].tolist())


@pytest.mark.slow
def test_no_net_of_matrices_has_the_distance_of_a_permutation_net():
    """Sect. 5.3.1: x is i / 32, y that of a product L U for it to be a net: all 2**20, on the torus."""
    index = np.arange(32)
    below = [(row, column) for row in range(5) for column in range(row)]
    lower = np.tile(index, (1024, 1))
    upper = np.tile(index, (1024, 1))
    for k, (row, column) in enumerate(below):
        chosen = (np.arange(1024) >> k & 1)[:, None]
        lower ^= chosen * (index >> column & 1) << row
        upper ^= chosen * (index >> row & 1) << column
    mirrored = np.array([int(f"{word:05b}"[::-1], 2) for word in index])
    largest = 0
    for table in mirrored[lower]:
        y = table[upper]
        least = np.full(1024, 999)
        for step in range(1, 6):
            apart = np.abs(y - np.roll(y, step, axis=1))
            least = np.minimum(least, (step**2 + np.minimum(apart, 32 - apart) ** 2).min(axis=1))
        largest = max(largest, least.max())
    assert largest == 29


def test_equation_6_1_is_an_image():
    """Not as printed, (1 + 1600 sin(x^2 + y^2)) / 2: that leaves [0, 1] by far, and goes once up and down."""
    x, y = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))
    printed = (1 + 1600 * np.sin(x**2 + y**2)) / 2
    assert printed.max() > 800
    assert np.all(np.diff(np.diag(printed)[: int(100 * (np.pi / 4) ** 0.5)]) > 0)
    points = np.stack([x, y], axis=-1).astype(np.float32)
    image = np.asarray(scenes.zone_plate()(points))
    assert 0 <= image.min() < 0.01 and 0.99 < image.max() <= 1


def test_whole_subtrees_can_be_reused_between_subsequent_frames():
    """Sect. 4.2.2: more than half of the nodes hold the same triangles in trees built anew, after 1/16."""

    def nodes(triangles):
        tree = trees.surface_area_tree(*meshes.corners(triangles))
        found = [frozenset([k]) for k in range(tree.size)]
        for one, other in tree.children:
            found.append(found[one] | found[other])
        return set(found[tree.size :])

    for made in moving_trees.SCENES.values():
        moving = made["draft"]()
        opened, first = moving.triangles[:2]
        later = opened + (first - opened) / (16 * moving.times[1])
        jumps = np.random.default_rng(1).normal(size=(len(opened), 1, 3))
        before, count = nodes(opened), len(opened) - 1
        assert len(before & nodes(later)) > 0.5 * count
        assert len(before & nodes(opened + jumps)) < 0.1 * count, "of arbitrary motion"


def test_motion_in_place_of_the_cameras_enlarges_boxes():
    """Sect. 3.2.1: boxes of still triangles that move against a camera which pans or tilts, by degrees."""
    mesh = meshes.made("rooms, tessellated", "draft")
    way = mesh.triangles - np.asarray(mesh.eye)
    for axes in ([0, 2], [1, 2]):
        areas = []
        for degrees in (0, 1, 5):
            moved = np.repeat(way[None], 9, axis=0)
            angles = np.radians(np.linspace(0, degrees, 9))[:, None, None]
            turned = way[..., axes] @ [1, 1j] * np.exp(1j * angles)
            moved[..., axes] = np.stack([turned.real, turned.imag], axis=-1)
            low, high = moved.min(axis=(0, 2)), moved.max(axis=(0, 2))
            areas.append(trees.summed_area(trees.surface_area_tree(low, high)))
        assert areas[1] > 1.1 * areas[0] and areas[2] > 1.5 * areas[0], areas


def test_errors_of_rotated_lattices_are_largest_along_their_diagonals():
    """Fig. 6.1: edges through pixels, by angle, each with a rotation of its own; 64 points."""
    lattice = np.asarray(sequences.rank1_lattice(64).points(64), np.float64)
    steps = np.round(64 * lattice[1:]).astype(int)
    steps = (steps + 32) % 64 - 32
    shortest = steps[np.argsort((steps**2).sum(axis=1))[:6:2]]  # each is there with its negative
    diagonals = np.degrees(np.arctan2(*shortest.T[::-1])) % 180
    rng, angles = np.random.default_rng(1), np.arange(0, 180, 3)
    across = np.stack([-np.sin(np.radians(angles)), np.cos(np.radians(angles))])
    fine = (np.indices((256, 256)).reshape(2, -1).T + 0.5) / 256 - 0.5
    exact = [np.sort(fine @ normal) for normal in across.T]
    squares = np.zeros(len(angles))
    for _ in range(256):
        place, depth = (lattice + rng.random(2)) % 1 - 0.5, rng.uniform(-0.35, 0.35)
        wanted = [np.searchsorted(of, depth) / len(fine) for of in exact]
        squares += ((place @ across < depth).mean(axis=0) - wanted) ** 2
    worst = angles[np.argsort(squares)[-3:]]
    assert abs(np.sort(worst) - np.sort(diagonals)).max() < 3, (worst, diagonals)
    assert squares[np.isin(angles, worst)].min() > 2 * np.median(squares)
