"""Measures of points, orders and images, and of run time against error.

Arguments are checked: TypeError and ValueError name the argument, what it must be and what was given.
"""

from analysis._compare import compare as compare
from analysis._comparison import Comparison as Comparison
from analysis._comparison import ComparisonRow as ComparisonRow
from analysis._convergence import ConvergenceRow as ConvergenceRow
from analysis._convergence import ConvergenceTable as ConvergenceTable
from analysis._convergence import convergence as convergence
from analysis._curves import curve_length as curve_length
from analysis._curves import segment_counts as segment_counts
from analysis._discrepancy_search import DiscrepancySearch as DiscrepancySearch
from analysis._discrepancy_search import search_discrepancy as search_discrepancy
from analysis._dispersion import dispersion as dispersion
from analysis._distance import min_distance as min_distance
from analysis._distance import squared_min_distance as squared_min_distance
from analysis._energies import riesz_energy as riesz_energy
from analysis._energies import soft_min_distance as soft_min_distance
from analysis._filtered import filtered_error as filtered_error
from analysis._filtered import low_frequency_power as low_frequency_power
from analysis._intervals import interval_counts as interval_counts
from analysis._intervals import is_latin_hypercube as is_latin_hypercube
from analysis._intervals import is_stratified as is_stratified
from analysis._l2_discrepancy import centered_discrepancy as centered_discrepancy
from analysis._l2_discrepancy import l2_star_discrepancy as l2_star_discrepancy
from analysis._l2_discrepancy import mixture_discrepancy as mixture_discrepancy
from analysis._l2_discrepancy import periodic_discrepancy as periodic_discrepancy
from analysis._l2_discrepancy import symmetric_discrepancy as symmetric_discrepancy
from analysis._l2_discrepancy import wraparound_discrepancy as wraparound_discrepancy
from analysis._matrix_search import MatrixSearch as MatrixSearch
from analysis._matrix_search import search_matrices as search_matrices
from analysis._neighbour_distances import NearestStatistics as NearestStatistics
from analysis._neighbour_distances import nearest_distances as nearest_distances
from analysis._neighbour_distances import nearest_statistics as nearest_statistics
from analysis._neighbours import neighbour_differences as neighbour_differences
from analysis._net_search import NetSearch as NetSearch
from analysis._net_search import search_net as search_net
from analysis._nets import projection_t_values as projection_t_values
from analysis._nets import t_value as t_value
from analysis._optimize import OptimizedPoints as OptimizedPoints
from analysis._optimize import optimize_points as optimize_points
from analysis._optimize_scrambling import OptimizedScrambling as OptimizedScrambling
from analysis._optimize_scrambling import optimize_scrambling as optimize_scrambling
from analysis._perceived import perceived_error as perceived_error
from analysis._pixel_means import pixel_means as pixel_means
from analysis._point_spectrum import point_spectrum as point_spectrum
from analysis._promises import broken_promises as broken_promises
from analysis._soft_star import soft_star_discrepancy as soft_star_discrepancy
from analysis._spectra import error_spectrum as error_spectrum
from analysis._spectra import mean_spectrum as mean_spectrum
from analysis._spectra import radial_anisotropy as radial_anisotropy
from analysis._spectra import radial_average as radial_average
from analysis._star_bounds import star_discrepancy_bounds as star_discrepancy_bounds
from analysis._star_discrepancy import star_discrepancy as star_discrepancy
from qmcjax.bridges import SequenceEngine as SequenceEngine
from qmcjax.bridges import read_points as read_points
