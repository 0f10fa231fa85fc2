"""The pages beside the figures, from ``index.html`` on: samplers, verdicts, pictures, images side by side."""

from figures.page._html import Markup as Markup
from figures.page._html import fill as fill
from figures.page._html import join as join
from figures.page._html import quantity as quantity
from figures.page._html import static as static
from figures.page._images import viewer as viewer
from figures.page._places import href as href
from figures.page._playground import SCRIPT as SCRIPT
from figures.page._playground import playground as playground
from figures.page._playground import script as playground_script
from figures.page._verdicts import assess as assess
from figures.page._write import FILES as FILES
from figures.page._write import write as write
