"""The pages beside the figures, from ``index.html`` on: samplers, verdicts, pictures, images side by side."""

from figures._markup import Markup as Markup
from figures.page._html import href as href
from figures.page._html import quantity as quantity
from figures.page._html import static as static
from figures.page._ledger import assess as assess
from figures.page._ledger import tables as ledger_tables
from figures.page._write import FILES as FILES
from figures.page._write import SCRIPT as SCRIPT
from figures.page._write import playground as playground
from figures.page._write import script as playground_script
from figures.page._write import write as write
