"""Several sub-samples of some coordinates for each sample of the others: trajectory splitting."""

from dataclasses import field
from typing import Any

import numpy as np
from jax import Array
from jax.typing import DTypeLike

from qmcjax.core import checks
from qmcjax.core.pytrees import frozen_pytree
from qmcjax.samplers._base import Sampler, joined


@frozen_pytree
class Split(Sampler):
    """Sample s has the split coordinates of sample s of a finer sampler, the others of ``s // count``."""

    whole: Sampler
    fine: Sampler
    """``whole.finer(count)``."""
    divided: tuple[int, ...] = field(metadata={"static": True})
    """The coordinates that have sub-samples."""
    count: int = field(metadata={"static": True})

    @property
    def dims(self) -> int:
        return self.whole.dims

    @property
    def limits(self) -> tuple[int, int, int]:
        return self.fine.limits

    def _shares(self, dims: tuple[int, ...]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the coordinates that are not split, and those that are."""
        return tuple(j for j in dims if j not in self.divided), tuple(j for j in dims if j in self.divided)

    def prepare(self, x: Array, y: Array, dims: tuple[int, ...]) -> Any:
        shares = zip((self.whole, self.fine), self._shares(dims), strict=True)
        return tuple(sampler.prepare(x, y, own) if own else None for sampler, own in shares)

    def points(self, state: Any, sample: Array, dims: tuple[int, ...], dtype: DTypeLike) -> Array:
        (whole, fine), (of_whole, of_fine), parts = self._shares(dims), state, []
        if whole:
            parts.append(self.whole.points(of_whole, sample // np.uint32(self.count), whole, dtype))
        if fine:
            parts.append(self.fine.points(of_fine, sample, fine, dtype))
        return joined(parts, (*whole, *fine), dims)

    def up_to(self, spp: int) -> "Split":
        whole = self.whole.up_to(-(-spp // self.count))
        return Split(whole, self.fine.up_to(spp), self.divided, self.count)

    def finer(self, count: int) -> Sampler:
        return self.fine.finer(count)

    def check(self, width: int, height: int, spp: int) -> None:
        self.fine.check(width, height, spp)

    def _checked(self, x: Array | int, y: Array | int, sample: Array | int) -> tuple[Array, Array, Array]:
        return self.fine._checked(x, y, sample)


def split(sampler: Sampler, dims: Any, count: Any) -> Split:
    """Split checked coordinates of a sampler; see :meth:`Sampler.split`."""
    count = checks.integer("count", count, 1, checks.INDEX_LIMIT - 1)
    divided = checks.dimensions(dims, sampler.dims)
    return Split(sampler, sampler.finer(count), tuple(sorted(set(divided))), count)
