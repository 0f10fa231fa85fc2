"""The parameters of a plugin in Mitsuba's dictionaries."""

import inspect
from collections.abc import Callable
from threading import Lock
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from qmcjax.core import checks
from qmcjax.samplers import Sampler, as_sampler

LIMIT = checks.INDEX_LIMIT - 1
"""Largest index of a sample, and largest number of samples."""

Made = TypeVar("Made")


class Window(NamedTuple):
    """The sampled pixels: the crop of a film and, if the film samples it, the border around it."""

    width: int
    height: int
    left: int
    top: int


class Given:
    """The parameters of a plugin, shared by its copies."""

    def __init__(self, properties: Any) -> None:
        for name in ("sampler", "film"):
            if name not in properties:
                raise ValueError(f"{name} must be a parameter of the plugin, got none")
        sampler, self.film = properties["sampler"], properties["film"]
        if not hasattr(sampler, "wrapped"):
            raise TypeError(
                f"sampler must be made by qmcjax.bridges.mitsuba.wrap, got {checks.shown(sampler)}"
            )
        if not hasattr(self.film, "crop_size"):
            raise TypeError(f"film must be the sensor's film, got {checks.shown(self.film)}")
        self.wrapped = sampler.wrapped
        self.key = checks.prng_key("key", properties.get("key", 0))
        self.first = checks.integer("first_sample", properties.get("first_sample", 0), 0, LIMIT)
        self.count = checks.integer("sample_count", properties.get("sample_count", 4), 1, LIMIT)
        side = properties.get("block_size", 0)
        self.block_side = 0 if side == 0 else checks.power_of_two("block_size", side, checks.MAX_SIDE)
        self._lock, self._size, self._made = Lock(), None, None
        self._used = False

    def window(self) -> Window:
        width, height = (int(side) + 2 * self._border for side in self.film.crop_size())
        return Window(width, height, *(int(start) for start in self.film.crop_offset()))

    def whole(self) -> tuple[int, int]:
        """Return the columns and rows of the whole film with its border, the image size of the sampler."""
        width, height = (int(side) + 2 * self._border for side in self.film.size())
        return width, height

    def check_film(self) -> None:
        """Raise unless the film is in use, as the sensor's is while Mitsuba renders."""
        if self._used:
            return
        try:
            self.film.develop(raw=True)
        except RuntimeError:
            raise ValueError(
                "film must be the sensor's film, got another: Mitsuba has not prepared it for an image. In "
                "loops of your own use seek, not seed"
            ) from None
        self._used = True

    def make_once(self, count: int, make: Callable[[Sampler], Made]) -> Made:
        """Return the object made from the sampler for ``count`` samples per pixel, once for all copies."""
        size = (*self.whole(), self.first + count) if of_size(self.wrapped) else ()
        with self._lock:
            if self._made is None or self._size != size:
                sampler = as_pixels("sampler", self.wrapped(*size) if size else self.wrapped)
                self._size, self._made = size, make(sampler)
            return self._made

    @property
    def _border(self) -> int:
        return int(self.film.rfilter().border_size()) if self.film.sample_border() else 0


def of_size(sampler: Any) -> bool:
    """Return whether an object is a function of (width, height, spp) that makes a sampler, not a sampler."""
    if not callable(sampler) or isinstance(sampler, type) or hasattr(sampler, "dims"):
        return False
    try:
        inspect.signature(sampler).bind(1, 1, 1)
    except (TypeError, ValueError):
        return False
    return True


def as_pixels(name: str, sampler: Any) -> Sampler:
    """Return a sampler of two coordinates or more."""
    sampler = as_sampler(name, sampler)
    if sampler.dims < 2:
        raise ValueError(f"{name} must have at least the two coordinates of a pixel, got {sampler.dims}")
    return sampler


def plug_in(mitsuba: ModuleType) -> Any:
    """Return what the classes of the plugin have in common, whatever the variant."""

    class QmcSampler(mitsuba.Sampler):
        def __init__(self, properties: Any, given: Given | None = None) -> None:
            super().__init__(properties)
            self.given = given or Given(properties)

        def fork(self) -> Any:
            properties = mitsuba.Properties()
            properties["sample_count"] = self.sample_count()
            return type(self)(properties, self.given)

        def clone(self) -> Any:
            other = self.fork()
            vars(other).update(vars(self))
            return other

        def to_string(self) -> str:
            of = checks.shown(self.given.wrapped)
            return f"QmcSampler[\n  sampler = {of},\n  sample_count = {self.sample_count()}\n]"

    return QmcSampler
