"""Samplers of a comparison, by numbers of samples and keys, and checks of what is compared."""

import inspect
from collections.abc import Mapping
from typing import Any

from analysis._comparing.promises import broken_promises, error_line
from qmcjax.core import checks
from qmcjax.samplers import Sampler, as_sampler


def validate_spps(spps: Any) -> list[int]:
    """Return numbers of samples per pixel; raise unless they are different and at least one."""
    try:
        given = list(spps)
    except TypeError:
        raise TypeError(f"spps must be numbers of samples per pixel, got {checks.shown(spps)}") from None
    given = [checks.integer("spps", spp, 1, 2**32 - 1) for spp in given]
    if not given or len(set(given)) < len(given):
        raise ValueError(f"spps must be one or more different numbers, got {given}")
    return given


def validate_named(kind: str, given: Any, what: str | None = None) -> None:
    """Raise unless names are mapped to something, such as samplers."""
    if not isinstance(given, Mapping):
        raise TypeError(f"{kind} must map names to {what or kind}, got {checks.shown(given)}")
    if not given:
        raise ValueError(f"{kind} must be one or more, got {given!r}")


class Maker:
    """The samplers of one method, by numbers of samples and keys."""

    def __init__(self, name: str, made: Any, width: int, height: int, keys: int) -> None:
        self.name, self._made, self._size = name, made, {"width": width, "height": height}
        self._parameters: list[str] | None = None
        if not hasattr(made, "dims") and callable(made) and not isinstance(made, type):
            self._parameters = list(inspect.signature(made).parameters)
            known = (*self._size, "spp", "key")
            unknown = [parameter for parameter in self._parameters if parameter not in known]
            if unknown:
                raise TypeError(
                    f"samplers[{name!r}] must be a function with parameters among {', '.join(known)}, got "
                    f"{', '.join(unknown)} (for one of x, y and sample, use samplers.function)"
                )
        self.keys = keys if "key" in (self._parameters or []) else 1

    def __call__(self, spp: int, key: int) -> Sampler:
        made = self._made
        if self._parameters is not None:
            given = {**self._size, "spp": spp, "key": key}
            try:
                made = made(**{parameter: given[parameter] for parameter in self._parameters})
            except Exception as error:
                raise ValueError(error_line(error)) from error
        return as_sampler(f"samplers[{self.name!r}]", made)

    def all(self, spp: int) -> tuple[Sampler, ...]:
        """Return the samplers of all keys."""
        return tuple(self(spp, key) for key in range(self.keys))

    def broken(self, spp: int) -> list[str]:
        """Return the promises that samplers break at this number of samples."""
        try:
            return broken_promises(self(spp, 0), **self._size, spp=spp)
        except ValueError as error:
            return [f"it cannot be made for {spp} samples: {error}"]
