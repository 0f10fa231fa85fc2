"""Names of dimensions for scenes with any number of them."""


def named(dims: int, names: tuple[str, ...] = ("x", "y")) -> tuple[str, ...]:
    """Return the names of all dimensions: those without a meaning are named u2, u3, ..."""
    return (*names, *(f"u{j}" for j in range(len(names), dims)))[:dims]
