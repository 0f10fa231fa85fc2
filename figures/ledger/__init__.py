"""What the papers claim, and whether it came out: verdicts are computed from the figures' numbers."""

from figures.ledger._ledger import FILE as FILE
from figures.ledger._ledger import PAPERS as PAPERS
from figures.ledger._ledger import SUITE as SUITE
from figures.ledger._ledger import Claim as Claim
from figures.ledger._ledger import Finding as Finding
from figures.ledger._ledger import claims as claims
from figures.ledger._ledger import findings as findings
from figures.ledger._ledger import left_out as left_out
from figures.ledger._ledger import reservation as reservation
from figures.ledger._ledger import stored as stored
from figures.ledger._ledger import to_store as to_store
