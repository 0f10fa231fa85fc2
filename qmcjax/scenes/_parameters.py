"""Names of the dimensions of scenes whose number is a parameter."""


def named(dims: int, names: tuple[str, ...] = ("x", "y")) -> tuple[str, ...]:
    """Return the names of all dimensions: those without a meaning are called u2, u3, ..."""
    return (*names, *(f"u{j}" for j in range(len(names), dims)))[:dims]
