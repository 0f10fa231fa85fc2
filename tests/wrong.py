"""Wrong arguments of public functions that their docstrings do not tell, by function and argument."""

import math

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from scipy.stats import qmc

from analysis import Filter
from qmcjax import orders, samplers, scenes, sequences, tracing

SAMPLER = samplers.z(4, 4, 4, 1)

VALUES = {
    "analysis.centered_discrepancy": dict(points=[np.zeros((1, 257))]),
    "analysis.compare": dict(
        keys=[0], measures=[{}, {"RMS error": max}, {"a": lambda *_: -1.0}, {"a": lambda *_: math.inf}],
        samplers=[{}], spps=[[4, 4], []]),
    "analysis.convergence": dict(keys=[0],
        reference=[(np.zeros((4, 5)), 0.0), (np.full((4, 4), np.nan), 0.0), (np.zeros((4, 4)), -1.0)],
        regions=[{}, {"mask": np.ones((3, 3), bool)}], samplers=[{}], spps=[[], [1, 0], [4, 1, 4]]),
    "analysis.denoised_error": dict(image=[np.ones((2, 2, 2)), np.full((2, 2), np.nan)],
        denoiser=[lambda image: image[0], lambda image: image * np.nan]),
    "analysis.design_samples": dict(integrands=["lines"]),
    "analysis.dispersion": dict(points=[np.zeros((3, 4))]),
    "analysis.expected_error": dict(
        filters=[-1.0, Filter([[1.0, -2.0]]), Filter(1.0, [[1.0]]), [Filter(weight=0.0)]],
        integrands=["lines", {"bumps": -1.0}, [], [scenes.occluder()], [lambda x: x / 0], lambda x, y: x - y],
        points=[np.zeros((3, 2)), np.ones((2, 2, 1, 2))]),
    "analysis.filtered_error": dict(sigma=[-1.0], time=[-1.0, [0.0], [[1.0]]]),
    "analysis.interval_counts": dict(digits=[(1,), (1, -1), (20, 9)], points=[np.zeros((1, 65))]),
    "analysis.minimize": dict(loss=[lambda free, key: np.zeros(2)], parameters=[{}, np.float32(np.nan)]),
    "analysis.optimize_points": dict(
        measure=[lambda p: p[0], lambda p: 1, lambda p: jnp.log(p[0, 0] - p[0, 0])]),
    "analysis.optimize_scrambling": dict(measure=[lambda p: p, lambda p: jnp.sqrt(-jnp.sum(p))],
        points=[[[0, 0], [1, 1], [2, 2]], [1, 2], [[1, 1], [2, 2]]]),
    "analysis.perceived_error": dict(distance=[0.0, math.inf]), "analysis.pixel_means": dict(dims=[(0, 2)]),
    "analysis.projection_t_values": dict(size=[3]),
    "analysis.riesz_energy": dict(exponent=[-1.0, math.inf], points=[np.zeros((1, 2))]),
    "analysis.search_discrepancy": dict(start=[np.zeros((3, 2)), np.zeros((5, 2)), np.ones((4, 2))]),
    "analysis.search_matrices": dict(
        budget_s=[0], dims=[4], steps=[0], targets=[{}, [(3, 12)], {17: 5}, {3: 0}, {3: 49}]),
    "analysis.search_net": dict(budget_s=[0]),
    "analysis.soft_min_distance": dict(exponent=[0.0], points=[np.zeros((1, 2))]),
    "analysis.squared_min_distance": dict(
        points=[np.zeros((1, 2), int), [[0, 4], [1, 1]], [[0, -1], [1, 1]]], shear=[5]),
    "analysis.t_value": dict(base=[4],
        points_or_matrices=[np.zeros((2, 4, 4)), np.zeros((2, 31), np.uint32), np.zeros((2, 32), np.int64),
                            np.zeros((2, 0, 0), int)]),
    "motion.affine": dict(matrix=[[1, 2, 3]]), "motion.approximated": dict(corners=[[1.0]], start=[1.0]),
    "motion.linear_segments": dict(times=[[0, 0]]),
    "motion.nurbs": dict(
        control=[[[1, 0]]], knots=[[0, 0, 0, 1, 1, 0], [0, 0, 0.5, 1, 1, 1], [1, 1, 1, 1, 1, 1]],
        weights=[[1, -1, 1], [1, 1, 0]]),
    "motion.rotation_box": dict(axis=[[0, 0, 0]], points=[[[1, 2]]]),
    "motion.rotation_spline": dict(keys=[[[0, 0, 0, 1]]]), "motion.slerp": dict(a=[[0, 0, 0, 2]]),
    "motion.straightened": dict(motion=[lambda t: (t, t)], times=[[0.0], [0.5, 0.5]]),
    "plot.convergence": dict(errors=[{"a": [1, 0]}]),
    "plot.difference": dict(reference=[np.zeros((2, 3))], scale=[0.0]),
    "plot.image": dict(image=[[[np.nan]], np.zeros(3)], limits=[(1, 0)]),
    "plot.order": dict(order=[orders.raster(2048, 1024)]),
    "plot.points": dict(points=[np.zeros((3, 3)), [[0.0, 1.0]]]),
    "plot.spectrum": dict(spectra=[np.zeros(3)]),
    "qmcjax.bridges.bake": dict(bits=[12], dims=[(7,)], tile=[(4, 0)]),
    "qmcjax.bridges.source": dict(dims=[(7,)], height=[0], name=["my sampler", "float"], spp=[0], width=[0]),
    "qmcjax.bridges.tabulate": dict(n=[0]),
    "qmcjax.bridges.write_image": dict(bits=[12], image=[[[0.0, 1.0, np.inf]], [0.5]]),
    "qmcjax.bridges.write_points": dict(path=["a.xyz"], points=[[[np.nan]]]),
    "qmcjax.estimated_reference": dict(spp=[100]),
    "qmcjax.integrate": dict(function=[jnp.sum, lambda p: ()], interval=["median", "t"],
        bounds=[(1, 1), (0, math.nan), [(0, 1)] * 3], limits=[(1, 0), ()], tolerance=[0.0, 1.0]),
    "qmcjax.orders.permutation": dict(
        image=[[[0, 1], [1, 2]], [[0, 1], [4, 2]], [[0, 1], [-1, 2]], [0, 1], np.zeros((0, 3), int)]),
    "qmcjax.orders.scrambled_morton": dict(alphabet=[16]),
    "qmcjax.recommend": dict(needs=[1, 251, ("x",)], frames=[0], size=[(0, 16)]),
    "qmcjax.samplers.blue_noise_mask": dict(channels=[0, 9], side=[1, 48, 1024], frames=[0, 65]),
    "qmcjax.samplers.designed": dict(spp=[3]),
    "qmcjax.samplers.dither": dict(
        mask=[np.zeros(4), np.zeros((0, 4)), np.ones((2, 2)), np.full((2, 2), np.nan)]),
    "qmcjax.samplers.full_screen": dict(
        net=[sequences.van_der_corput(3), sequences.halton(1), sequences.owen(sequences.sobol(2), 1),
             sequences.digital_shift(sequences.uniform(2, 1), 1), sequences.uniform(2, 0)]),
    "qmcjax.samplers.interleaved": dict(positions=[samplers.independent(sequences.sobol(1), 1)]),
    "qmcjax.samplers.partitioned": dict(
        component=[1], sequence=[sequences.halton(1), sequences.larcher_pillichshammer()]),
    "qmcjax.samplers.randomized": dict(spp=[0]), "qmcjax.samplers.ranked": dict(dims=[5]),
    "qmcjax.samplers.tiled": dict(
        points=[np.zeros((4, 4, 1, 3)), np.ones((4, 4, 1, 2)), np.zeros((4, 3, 1, 2))]),
    "qmcjax.samplers.z": dict(alphabet=[9], constituents=[(2, 3), ()], spp=[0, 2**32, 12]),
    "qmcjax.scenes.ball": dict(ends=[[[0.5, 0.5]]], starts=[[0.5, 0.5]], times=[(), [1.0]]),
    "qmcjax.scenes.blinking_disc": dict(centre=[[1, 2, 3]], on=[(0.5, 0.5)]),
    "qmcjax.scenes.caustic": dict(radius=[0], roughness=[2.0]),
    "qmcjax.scenes.checkerboard": dict(squares=[math.inf, jnp.float32(-2), [1.0, 20.0]]),
    "qmcjax.scenes.cornell_box": dict(bounces=[-1], light=[2.5, 0.0], shutter=[(0.5, 0.1)]),
    "qmcjax.scenes.defocused_edge": dict(angle=[math.inf]), "qmcjax.scenes.disc": dict(centre=[(1, 2, 3)]),
    "qmcjax.scenes.flat_checkerboard": dict(squares=[float("inf")]),
    "qmcjax.scenes.gaussian": dict(centre=[0.5, (0.5, math.nan)]),
    "qmcjax.scenes.genz": dict(difficulty=[[1, 0]], family=["flat"], shift=[math.inf]),
    "qmcjax.scenes.helicopter": dict(shutter=[1.5], turns=[np.inf]),
    "qmcjax.scenes.interior": dict(roulette=[0]), "qmcjax.scenes.moving_edge": dict(velocity=[[1.0]]),
    "qmcjax.scenes.path_toy": dict(albedo=[1.5]), "qmcjax.scenes.product": dict(a=[[1.0], [1.0, -1.0]]),
    "qmcjax.scenes.soft_shadow": dict(light=[(0.5, 0.0)]), "qmcjax.scenes.sports": dict(distance=[(1, 2)]),
    "qmcjax.scenes.staircase": dict(offsets=[[], [1, float("inf")]]),
    "qmcjax.scenes.step": dict(offset=[[1.0]]),
    "qmcjax.scenes.triangle": dict(vertices=[[(0, 0), (0.1, 0.1), (0.3, 0.3)], [(0, 0), (1, 1)]]),
    "qmcjax.scenes.zone_plate": dict(frequency=[math.inf, jnp.float32(-2), [1.0, 20.0]]),
    "qmcjax.sequences.components": dict(dims=[(), (0, 99), (1, 0, 1)]),
    "qmcjax.sequences.digital": dict(matrices=[np.zeros((2, 31), np.uint32)]),
    "qmcjax.sequences.direction_numbers_text": dict(numbers=[[], [(3, [1]), (5, [1, 1])]]),
    "qmcjax.sequences.faure": dict(base=[4, 1, 8209]),
    "qmcjax.sequences.gray": dict(sequence=[sequences.jittered(3, 2, 0)]),
    "qmcjax.sequences.inverted": dict(net=[sequences.van_der_corput()]),
    "qmcjax.sequences.kronecker": dict(steps=[[], [math.nan], [math.inf], [0.5, 3]]),
    "qmcjax.sequences.net_by_net": dict(sequence=[sequences.digital(np.zeros((1, 32), np.uint32))]),
    "qmcjax.sequences.permutation_net_in_row": dict(
        index=[16, np.array([3, 17], np.uint32)], row=[-1, -np.arange(3)]),
    "qmcjax.sequences.poisson_disk": dict(radius=[0.0, 1e-3], sides=[(1.0,), (1,) * 5, (1, 0)]),
    "qmcjax.sequences.record_net": dict(discrepancy=["l2"], n=[17]),
    "qmcjax.sequences.rotate": dict(offset_or_key=[[0.5], 0.5, [0.5, 1.0], [-0.25, 0.0], [np.nan, 0.0]]),
    "qmcjax.sequences.sobol_of": dict(
        numbers=[*([], [(3, [1]), (5, [1, 1])], [(7, [1])], [(7, [1, 2])], [(7, [3, 1])], [(7, [1, -1])]),
                 *([(polynomial, [1, 3])] for polynomial in (2, 21, 1))]),
    "qmcjax.sequences.tabulated": dict(points=[[0.5], [[0.5, 1.0]], [[np.nan]]]),
    "qmcjax.warps.discrete": dict(weights=[[], [0.0], [-1.0, 2.0], [np.inf]]),
    "qmcjax.warps.triangle": dict(vertices=[np.zeros((3, 2)), np.eye(2), [[0, 0], [1, 1], [2, 2]]]),
    "tracing.box": dict(high=[[1, 0, 1]]),
    "tracing.camera": dict(
        focus=[1], up=[[1, 1e-7, -1]], position=[[0, 0, np.nan]], shutter=[(0.7, 0.2), 1.5],
        target=[[0, 0, 1]]),
    "tracing.cylinder": dict(axis=[[0, 0, 0]]), "tracing.diffuse": dict(color=[1.1, [0.1, 0.2]]),
    "tracing.disc": dict(normal=[[0, 0, 0]], radius=[1e-46]), "tracing.emitter": dict(radiance=[-1]),
    "tracing.glossy": dict(roughness=[0.0099, 1.01]), "tracing.group": dict(parts=[[]]),
    "tracing.plane": dict(normal=[[0, 1e-46, 0], [0, 0, 0]]),
    "tracing.point_light": dict(intensity=[-1], position=[[0, 0], [0, 1e39, 0]]),
    "tracing.rectangle": dict(edge_v=[[2, 0, 0]]), "tracing.rectangle_light": dict(edge_v=[[2, 0, 0]]),
    "tracing.sphere": dict(center=[[0, 0], [0, np.nan, 0], [1e39, 0, 0]], radius=[0.0, 1e-46, [1.0, 2.0]]),
    "tracing.sphere_light": dict(radius=[0, 1e-46]), "tracing.visible_intervals": dict(shutter=[(0.5, 0.2)]),
    "tracing.world": dict(lights=[[tracing.environment(1)] * 2]),
    "trees.nodes_visited": dict(direction=[[0.0, 0, 0]], origin=[[0, 0]]),
    "trees.refitted": dict(times=[[1, 0]]), "trees.triangle_distances": dict(number=[[4]]),
    "trees.surface_area": dict(low=[[0, 0]]),
    "trees.surface_area_tree": dict(
        high=[[[1e99, 1, 1]]], low=[[[0, 0]], np.zeros((0, 3)), [[0, 0, np.nan]]]),
}  # fmt: skip
"""Out of range, of another shape, or not one of those that there are."""

TYPES = {
    "analysis.compare": dict(
        measures=[{"one": lambda image: 0}], samplers=[[SAMPLER], {"a": lambda n: n}, {"a": lambda key: key}],
        scenes=[{"a": 3}, {"a": scenes.function(jnp.ravel, ("x", "y"))}], spps=[4]),
    "analysis.convergence": dict(progress=[1],
        reference=[np.zeros((4, 4)), (np.zeros((4, 4)),), ("image", 0.0), (np.zeros((4, 4)), None)],
        regions=[[np.s_[:]]], samplers=[[SAMPLER], {"a": 3}], scene=[SAMPLER], spps=[4, [1.0]]),
    "analysis.expected_error": dict(
        filters=["gauss"], integrands=[None, [3]], points=[np.zeros((2, 2, 1, 2), int)]),
    "analysis.interval_counts": dict(digits=[1]), "analysis.is_stratified": dict(digits=[(0.5, 1)]),
    "analysis.mean_spectrum": dict(keys=["x", 3], make=[SAMPLER]),
    "motion.straightened": dict(motion=[lambda t: None]), "plot.convergence": dict(errors=[[1, 0]]),
    "plot.points": dict(ax=[Figure()]), "qmcjax.bridges.bake": dict(tile=[4]),
    "qmcjax.bridges.tabulate": dict(generator=[qmc.Sobol]), "qmcjax.recommend": dict(size=[16]),
    "qmcjax.scenes.checkerboard": dict(squares=["a"]), "qmcjax.scenes.zone_plate": dict(frequency=["a"]),
    "qmcjax.sequences.direction_numbers": dict(sequence=[sequences.halton(2)]),
    "qmcjax.sequences.direction_numbers_text": dict(numbers=[7, [7], [(3, [1.0])]]),
    "qmcjax.sequences.lattice_text": dict(lattice=[sequences.lattice(2)]),
    "qmcjax.sequences.kronecker": dict(steps=[2, [0.5, "x"], [0.5, True]]),
    "qmcjax.sequences.net_by_net": dict(sequence=[sequences.uniform(2, 0)]),
    "qmcjax.sequences.sobol_of": dict(numbers=[7, [7], [(3, [1.0])]]), "tracing.camera": dict(shutter=["a"]),
    "tracing.group": dict(parts=[[3]]), "tracing.sphere": dict(material=["red"]),
    "tracing.world": dict(objects=[[1]]),
}  # fmt: skip
"""Of another type."""
