"""A user's sampler against those of the papers: ``qmcjax compare my_module:make_sampler``."""

from figures.arena._command import main as main
