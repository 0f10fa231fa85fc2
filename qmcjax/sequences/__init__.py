"""Low discrepancy sequences and nets: functions from an index to a point, with random access.

Every sequence ``seq`` has ``seq(index)``, ``seq.points(n, start)``, ``seq.dims`` and ``seq.size`` (None if
unbounded). Sequences in base 2 also have exact fixed-point coordinates, ``seq.bits(index)``. Indices are
integers below 2**32. Sequences with a size support ``len`` and slices. Any object with ``dims`` and a call is
a sequence: see :func:`as_sequence`.
"""

from qmcjax.sequences._digital.cells import Invertible as Invertible
from qmcjax.sequences._digital.constructions import DigitalNet as DigitalNet
from qmcjax.sequences._digital.constructions import cascaded_net as cascaded_net
from qmcjax.sequences._digital.constructions import niederreiter_xing as niederreiter_xing
from qmcjax.sequences._digital.constructions import one_two as one_two
from qmcjax.sequences._digital.constructions import sz as sz
from qmcjax.sequences._digital.digital import Digital as Digital
from qmcjax.sequences._digital.digital import digital as digital
from qmcjax.sequences._digital.digital import inverted as inverted
from qmcjax.sequences._digital.digital import larcher_pillichshammer as larcher_pillichshammer
from qmcjax.sequences._digital.digital import sobol as sobol
from qmcjax.sequences._digital.direction_numbers import direction_numbers as direction_numbers
from qmcjax.sequences._digital.direction_numbers import direction_numbers_text as direction_numbers_text
from qmcjax.sequences._digital.direction_numbers import read_direction_numbers as read_direction_numbers
from qmcjax.sequences._digital.direction_numbers import sobol_of as sobol_of
from qmcjax.sequences._digital.halton import RadicalInverses as RadicalInverses
from qmcjax.sequences._digital.halton import halton as halton
from qmcjax.sequences._digital.halton import van_der_corput as van_der_corput
from qmcjax.sequences._digital.matrix_files import matrices_text as matrices_text
from qmcjax.sequences._digital.matrix_files import read_matrices as read_matrices
from qmcjax.sequences._digital.prime_digital import faure as faure
from qmcjax.sequences._digital.prime_digital import quad_optimized as quad_optimized
from qmcjax.sequences._digital.sobol_matrix import DirectionNumbers as DirectionNumbers
from qmcjax.sequences._nets.components import cbc_lattice as cbc_lattice
from qmcjax.sequences._nets.components import korobov as korobov
from qmcjax.sequences._nets.lattice_sequence import Multiples as Multiples
from qmcjax.sequences._nets.lattice_sequence import kronecker as kronecker
from qmcjax.sequences._nets.lattice_sequence import lattice as lattice
from qmcjax.sequences._nets.lattice_sequence import roberts as roberts
from qmcjax.sequences._nets.nets import Net as Net
from qmcjax.sequences._nets.nets import hammersley_net as hammersley_net
from qmcjax.sequences._nets.nets import larcher_pillichshammer_net as larcher_pillichshammer_net
from qmcjax.sequences._nets.nets import larcher_pillichshammer_net_3d as larcher_pillichshammer_net_3d
from qmcjax.sequences._nets.nets import sobol_net_3d as sobol_net_3d
from qmcjax.sequences._nets.permutation_nets import permutation_net as permutation_net
from qmcjax.sequences._nets.permutation_nets import permutation_net_3d as permutation_net_3d
from qmcjax.sequences._nets.permutation_nets import permutation_net_in_row as permutation_net_in_row
from qmcjax.sequences._nets.rank1_lattice import lattice_text as lattice_text
from qmcjax.sequences._nets.rank1_lattice import rank1_lattice as rank1_lattice
from qmcjax.sequences._nets.rank1_lattice import read_lattice as read_lattice
from qmcjax.sequences._nets.searched import optimized_net as optimized_net
from qmcjax.sequences._nets.searched import optimized_net_3d as optimized_net_3d
from qmcjax.sequences._nets.searched import optimized_sequence as optimized_sequence
from qmcjax.sequences._nets.searched import record_net as record_net
from qmcjax.sequences._protocol.base import Sequence as Sequence
from qmcjax.sequences._protocol.binary import BinarySequence as BinarySequence
from qmcjax.sequences._protocol.binary import Blocks as Blocks
from qmcjax.sequences._protocol.binary import as_binary as as_binary
from qmcjax.sequences._protocol.plug_in import SequenceLike as SequenceLike
from qmcjax.sequences._protocol.plug_in import as_sequence as as_sequence
from qmcjax.sequences._protocol.plug_in import function as function
from qmcjax.sequences._protocol.plug_in import tabulated as tabulated
from qmcjax.sequences._scrambling.interlaced import Interlaced as Interlaced
from qmcjax.sequences._scrambling.interlaced import interlaced as interlaced
from qmcjax.sequences._scrambling.mapped import Mapped as Mapped
from qmcjax.sequences._scrambling.owen import OwenDigits as OwenDigits
from qmcjax.sequences._scrambling.owen import OwenHash as OwenHash
from qmcjax.sequences._scrambling.owen import art_owen as art_owen
from qmcjax.sequences._scrambling.owen import owen as owen
from qmcjax.sequences._scrambling.owen_exact import owen_exact as owen_exact
from qmcjax.sequences._scrambling.selections import InTime as InTime
from qmcjax.sequences._scrambling.selections import components as components
from qmcjax.sequences._scrambling.selections import gray as gray
from qmcjax.sequences._scrambling.selections import in_time as in_time
from qmcjax.sequences._scrambling.shifts import digit_scramble as digit_scramble
from qmcjax.sequences._scrambling.shifts import digital_shift as digital_shift
from qmcjax.sequences._scrambling.shifts import (
    linear_matrix_scramble as linear_matrix_scramble,
)
from qmcjax.sequences._scrambling.shifts import rotate as rotate
from qmcjax.sequences._stochastic.blue_noise import lloyd as lloyd
from qmcjax.sequences._stochastic.blue_noise import poisson_disk as poisson_disk
from qmcjax.sequences._stochastic.multi_jitter import multi_jitter as multi_jitter
from qmcjax.sequences._stochastic.net_by_net import net_by_net as net_by_net
from qmcjax.sequences._stochastic.net_by_net import pmj02 as pmj02
from qmcjax.sequences._stochastic.random import jittered as jittered
from qmcjax.sequences._stochastic.random import latin_hypercube as latin_hypercube
from qmcjax.sequences._stochastic.random import uniform as uniform
