"""The choice of a sampler: candidates, their measured errors, and recommendations."""

from qmcjax.choosing._candidates import CANDIDATES as CANDIDATES
from qmcjax.choosing._candidates import Candidate as Candidate
from qmcjax.choosing._recommend import Recommendation as Recommendation
from qmcjax.choosing._recommend import recommend as recommend
from qmcjax.choosing._table import ANIMATED as ANIMATED
from qmcjax.choosing._table import DENOISED as DENOISED
from qmcjax.choosing._table import KINDS as KINDS
from qmcjax.choosing._table import LEVELS as LEVELS
from qmcjax.choosing._table import MEASURES as MEASURES
from qmcjax.choosing._table import SETTINGS as SETTINGS
from qmcjax.choosing._table import SHOWN as SHOWN
from qmcjax.choosing._table import SIZES as SIZES
from qmcjax.choosing._table import SPPS as SPPS
from qmcjax.choosing._table import STILL as STILL
from qmcjax.choosing._table import ErrorRatio as ErrorRatio
from qmcjax.choosing._table import Measured as Measured
from qmcjax.choosing._table import Setting as Setting
from qmcjax.choosing._table import has_edges as has_edges
from qmcjax.choosing._table import worst_cases as worst_cases
