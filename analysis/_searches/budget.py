"""The budget of a search: steps, seconds, or both."""

import math
import time


class Budget:
    """Limits on steps and seconds, either of which ends a search; None is no limit."""

    def __init__(self, steps: int | None, seconds: float | None) -> None:
        self.steps, self._began = 0, time.monotonic()
        self._most = math.inf if steps is None else steps
        self._limit = math.inf if seconds is None else seconds

    def seconds(self) -> float:
        """Return the time since the start."""
        return time.monotonic() - self._began

    def spent(self) -> float:
        """Return the fraction of the budget spent, 1 or more at the end."""
        return max(self.steps / self._most, self.seconds() / self._limit)

    def step(self) -> bool:
        """Count one more step, if the budget allows it."""
        allowed = self.spent() < 1
        self.steps += allowed
        return allowed
