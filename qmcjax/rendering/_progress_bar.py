"""Progress bars."""

import sys
from collections.abc import Callable
from typing import Any

from qmcjax.core import checks


def progress_bar(label: str = "") -> Callable[[float], None]:
    """Return a bar with the remaining time, for any argument ``progress``.

    It is drawn to ``sys.stderr`` in a terminal or a notebook only: logs of batch jobs stay short.

    Parameters
    ----------
    label : str
        Text before the bar.

    Returns
    -------
    callable
        A function of the finished part, in [0, 1]. The part finished at the first call, such as work found in
        a checkpoint, does not count for the remaining time. After 1, or after a smaller part than before, a
        new bar begins.

    Examples
    --------
    >>> from qmcjax import progress_bar, render, samplers, scenes, sequences
    >>> sampler = samplers.independent(sequences.sobol(2), key=1)
    >>> image = render(scenes.disc(), sampler, 16, 16, spp=4, progress=progress_bar("disc"))
    """
    if not isinstance(label, str):
        raise TypeError(f"label must be a str, got {checks.shown(label)}")
    from tqdm import tqdm  # Imported only for a bar.

    bar: Any = None

    def report(finished: float) -> None:
        nonlocal bar
        if bar is not None and finished < bar.n:
            bar.close()
            bar = None
        if bar is None:
            seen = sys.stderr.isatty() or "ipykernel" in sys.modules
            bar = tqdm(
                desc=label or None,
                total=1.0,
                initial=finished,
                bar_format="{desc}{percentage:3.0f}%|{bar}| {elapsed}<{remaining}",
                smoothing=0,
                disable=not seen,
            )
        bar.update(finished - bar.n)
        if finished >= 1:
            bar.close()
            bar = None

    return report
