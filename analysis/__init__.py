"""Measures of points, orders, images, and of run time against error."""

from analysis._convergence import ConvergenceRow as ConvergenceRow
from analysis._convergence import ConvergenceTable as ConvergenceTable
from analysis._convergence import convergence as convergence
from analysis._curves import segment_counts as segment_counts
from analysis._distance import min_distance as min_distance
from analysis._distance import squared_min_distance as squared_min_distance
from analysis._filtered import filtered_error as filtered_error
from analysis._filtered import low_frequency_power as low_frequency_power
from analysis._intervals import interval_counts as interval_counts
from analysis._intervals import is_latin_hypercube as is_latin_hypercube
from analysis._intervals import is_stratified as is_stratified
from analysis._matrix_search import MatrixSearch as MatrixSearch
from analysis._matrix_search import search_matrices as search_matrices
from analysis._neighbours import neighbour_differences as neighbour_differences
from analysis._net_search import NetSearch as NetSearch
from analysis._net_search import search_net as search_net
from analysis._nets import projection_t_values as projection_t_values
from analysis._nets import t_value as t_value
from analysis._pixel_means import pixel_means as pixel_means
from analysis._spectra import error_spectrum as error_spectrum
from analysis._spectra import radial_average as radial_average
from analysis._star_bounds import star_discrepancy_bounds as star_discrepancy_bounds
from analysis._star_discrepancy import star_discrepancy as star_discrepancy
