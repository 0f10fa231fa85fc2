"""Cells of figures: computed once, kept when a figure is interrupted, and as they were."""

import os
import signal
from functools import partial

import numpy as np
import pytest
from test_figures_cli import GOOD, Project, wait_for

from figures.making import finished_cells

CELLS = GOOD.replace(
    "    progress(0.5)",
    """
    import time
    from functools import partial
    from figures.making import finished_cells

    def computed(name):
        with Path("cells").open("a") as file:
            print(name, file=file)
        while name == "a" and Path("slow").exists():
            time.sleep(0.02)
        return ord(name)

    found = finished_cells.shared("cells", {name: partial(computed, name) for name in "abc"}, progress)
    assert {name: int(cell) for name, cell in found.items()} == {"a": 97, "b": 98, "c": 99}
""",
)


@pytest.mark.parametrize("kept", [False, True])
def test_cells_are_what_they_are_computed_to(tmp_path, kept):
    """Bit by bit, in their order, from the last to the first."""
    arrays = {"a": np.float64(0.1), "b": np.arange(6, dtype=np.uint8).reshape(2, 3), "c": np.array([-0.0, 1])}
    taken, parts = [], []

    def computed(name):
        taken.append(name)
        return arrays[name]

    token = finished_cells.PLACE.set(finished_cells.Place(tmp_path / "kept") if kept else None)
    try:
        for _ in range(2):
            found = finished_cells.shared(
                "label", {name: partial(computed, name) for name in arrays}, parts.append
            )
            assert list(found) == list(arrays)
            for name, array in arrays.items():
                assert found[name].dtype == array.dtype and found[name].shape == array.shape
                assert found[name].tobytes() == array.tobytes()
        other = finished_cells.shared("other", {"a": partial(computed, "b")})
    finally:
        finished_cells.PLACE.reset(token)
    assert parts == [1 / 3, 2 / 3, 1] * 2
    assert other["a"].tolist() == arrays["b"].tolist(), "of another label"
    assert taken == [*"cba", "b"] if kept else [*"cbacba", "b"]


@pytest.mark.slow
def test_a_killed_figure_goes_on(tmp_path):
    """Also if a cell is damaged: it is computed anew. Nothing is left of them in the end."""
    project = Project(tmp_path, one=CELLS)
    (tmp_path / "slow").touch()
    process = project.start()
    wait_for(lambda: (tmp_path / "cells").exists() and "a" in (tmp_path / "cells").read_text())
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    kept = sorted((project.out / ".cells" / "one").glob("*/*.npy"))
    assert len(kept) == 2
    kept[0].write_bytes(kept[0].read_bytes()[:-1])

    (tmp_path / "slow").unlink()
    assert project.run()[::2] == (0, "")
    cells = (tmp_path / "cells").read_text().split()
    assert sorted(cells[:3]) == ["a", "b", "c"]
    assert len(cells) == 5 and "a" in cells[3:]
    assert project.files() == ["index.html", "numbers.json", "one.png", "one.webp"]
