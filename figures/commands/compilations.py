"""Which programs take longest to compile: ``python -m figures compilations [names...]``."""

import importlib
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from figures._options import add_quality, command
from figures._rc import rc
from figures.catalogue import CATALOGUE
from figures.making import compiled_programs
from figures.making.worker import forget_programs

EVENT = "/jax/core/compile/backend_compile_duration"
SHOWN = 10


class Program(NamedTuple):
    """What was compiled, in how many seconds, and for which figure."""

    seconds: float
    name: str
    figure: str


def main(argv: Sequence[str] | None = None) -> int:
    """Make figures one after the other with nothing kept, and print the slowest compilations."""
    parser = command(
        "compilations",
        "Make figures one after the other in one process, with nothing kept from other runs, "
        "write none of them, and print the programs that took longest to compile. One that figures share "
        "counts for the first. What figures measure in processes of their own is not seen.",
    )
    parser.add_argument("names", nargs="*", metavar="name", help="figures to make (default: all)")
    add_quality(parser)
    options = parser.parse_args(argv)
    unknown = [name for name in options.names if name not in CATALOGUE]
    if unknown:
        parser.error(f"unknown figure {unknown[0]!r}: python -m figures --list names them")
    modules = {name: CATALOGUE[name].module for name in dict.fromkeys(options.names or CATALOGUE)}
    print("\n".join(_listing(compiled(modules, options.quality))))
    return 0


def compiled(modules: dict[str, str], quality: str) -> list[Program]:
    """Return the programs that figures compile, in order; ``modules``: by the figures' names."""
    compiled_programs.measure_without()
    if quality == "draft":
        compiled_programs.quickly()
    import jax
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    programs: list[Program] = []
    heard: list[tuple[float, str]] = []

    def hear(event: str, duration_secs: float, **of: str | int) -> None:
        if event == EVENT:
            heard.append((duration_secs, str(of.get("fun_name", ""))))

    jax.monitoring.register_event_duration_secs_listener(hear)
    try:
        for figure, module in modules.items():
            make: Callable = importlib.import_module(module).make
            with rc():
                make(quality, lambda fraction: None)
            plt.close("all")
            programs += [Program(*each, figure) for each in heard]
            heard.clear()
            forget_programs()
    finally:
        jax.monitoring.unregister_event_duration_listener(hear)
    return programs


def _listing(programs: Sequence[Program]) -> Iterable[str]:
    slowest = sorted(programs, reverse=True)[:SHOWN]
    yield f"{'seconds':>8}  {'program':<40}  figure"
    for each in slowest:
        yield f"{each.seconds:8.2f}  {each.name:<40}  {each.figure}"
    yield f"{sum(each.seconds for each in programs):8.2f}  all {len(programs)} programs"
    together: dict[tuple[str, str], list[float]] = {}
    for each in programs:
        together.setdefault((each.name, each.figure), []).append(each.seconds)
    often = sorted(together.items(), key=lambda item: sum(item[1]), reverse=True)[:SHOWN]
    yield ""
    yield f"{'seconds':>8}  {'times':>5}  {'program, for each shape and choice':<40}  figure"
    for (name, figure), seconds in often:
        yield f"{sum(seconds):8.2f}  {len(seconds):5}  {name:<40}  {figure}"
