"""From the public call to the test of a triangle there are few steps, each with few arguments."""

import ast
import inspect
from pathlib import Path

import numpy as np
import pytest

import qmcjax
from qmcjax import tracing
from qmcjax.tracing._shapes.triangles import WORTHWHILE, Triangles

ROOT = Path(qmcjax.__file__).parent
COMPILED = sorted((ROOT / "tracing" / "search").glob("compiled_*.py"))


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, WORTHWHILE])
def test_a_ray_meets_a_triangle_within_twelve_frames(count, monkeypatch):
    """Loops over all triangles take 12 frames, as does traversal of their tree."""
    test, depths = Triangles.distance, []

    def counted(*given):
        frames = [frame.filename for frame in inspect.stack()[1:]]
        depths.append(sum(Path(name).is_relative_to(ROOT) for name in frames) + 1)
        return test(*given)

    monkeypatch.setattr(Triangles, "distance", counted)
    monkeypatch.setattr("qmcjax.tracing.search.intersection.find_spec", lambda name: None)
    monkeypatch.setattr("qmcjax.tracing.search.intersection._MANY", WORTHWHILE)
    corners = np.eye(3) + np.arange(count)[:, None, None]
    # So many rays are traced nowhere else: the program is compiled here.
    hit = tracing.nearest_hit(tracing.world([tracing.triangles(corners)]), np.full((83, 3), -1.0), np.ones(3))
    assert np.all(hit.shape == 0) and depths and max(depths) <= 12


@pytest.mark.parametrize("path", COMPILED, ids=lambda path: path.stem)
def test_compiled_functions_have_at_most_eight_parameters(path):
    functions = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.FunctionDef)]
    assert len(functions) > 2 and all(len(node.args.args) <= 8 for node in functions)
