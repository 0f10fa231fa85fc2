"""Measures of points, orders, images, and of run time against error."""

from analysis._convergence import ConvergenceRow as ConvergenceRow
from analysis._convergence import ConvergenceTable as ConvergenceTable
from analysis._convergence import convergence as convergence
from analysis._curves import segment_counts as segment_counts
from analysis._distance import min_distance as min_distance
from analysis._distance import squared_min_distance as squared_min_distance
from analysis._spectra import error_spectrum as error_spectrum
from analysis._spectra import radial_average as radial_average
