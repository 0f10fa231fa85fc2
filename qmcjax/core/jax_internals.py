"""Everything this library uses from JAX outside its documented interface, except reading jaxprs.

:func:`primitive`: operations with rules for derivatives in both modes, of any order, and for ``vmap``. Each
documented way lacks one of these: ``jax.custom_vjp`` refuses forward mode; ``jax.custom_jvp`` leaves the
transpose of tangents to JAX, which does not exist for a loop over an unknown number of terms. ``lax.scan``
over ``jax.checkpoint`` supports all of them, but does not compensate gradients (the mean of 2^17 derivatives
of 0.1 is 0.09990), recompiles for each number of terms, with up to twice the compile time, and gradients of
images with 256 samples per pixel took 4.3 times the memory.

:func:`varying`: instead of the axes that ``str(jax.typeof(array))`` shows.

``FLAGS``: names of options of ``jax.config.update``; versions add and drop some.

Tried with JAX 0.10.0, 0.10.2 and 0.12.0.1.
"""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.core import eval_jaxpr as eval_jaxpr
from jax.interpreters import ad, batching, mlir

Zero = ad.Zero
"""Tangents and cotangents that are known to be zero."""

Unknown = ad.UndefinedPrimal
"""Operands for which a rule returns cotangents; ``aval`` has their shape and dtype."""

zeros = ad.zeros_like_aval
instantiated = ad.instantiate_zeros

COMMON_FLAGS = (
    *("enable_x64", "default_matmul_precision", "softmax_custom_jvp", "use_direct_linearize", "use_magma"),
    *("default_prng_impl", "threefry_partitionable", "threefry_gpu_kernel_lowering", "random_seed_offset"),
    *("high_dynamic_range_gumbel", "disable_jit", "disable_most_optimizations", "compiler_enable_remat_pass"),
    *("optimization_level", "memory_fitting_level"),
)

# The first two until 0.10, the others from 0.12 on.
FLAGS = (
    *COMMON_FLAGS,
    *("exec_time_optimization_effort", "memory_fitting_effort"),
    *("accurate_erf_inv", "use_hlo_logistic_lowering"),
)
"""Flags that change results: precision, derivatives, random numbers, compilation."""


def primitive(
    name: str,
    function: Callable[..., list[Any]],
    outlines: Callable[..., list[Any]],
    jvp: Callable[..., Any],
    transpose: Callable[..., Any],
    batch: Callable[..., Any],
) -> Any:
    """Return an operation on arrays; ``bind`` calls it.

    All rules take the static parameters as keywords. They run in the precision of their arguments: JAX may
    call them outside the context that enabled float64.
    """
    from jax.extend.core import Primitive  # jax.extend imports Pallas, which takes longer than this library.

    made = Primitive(name)
    made.multiple_results = True
    made.def_impl(function)
    made.def_abstract_eval(outlines)
    mlir.register_lowering(made, mlir.lower_fun(_in_precision(function), multiple_results=True))
    ad.primitive_jvps[made] = _in_precision(jvp)
    ad.primitive_transposes[made] = _in_precision(transpose)
    batching.primitive_batchers[made] = _in_precision(batch)
    return made


def _in_precision(rule: Callable[..., Any]) -> Callable[..., Any]:
    def in_precision(*args: Any, **how: Any) -> Any:
        wide = any(getattr(leaf, "dtype", None) == np.float64 for leaf in jax.tree.leaves(args))
        with jax.enable_x64(wide or jax.dtypes.canonicalize_dtype(np.float64) == np.float64):
            return rule(*args, **how)

    return in_precision


def varying(leaf: Any) -> frozenset[Any]:
    """Return the axes of a mesh over which an array varies, inside ``jax.shard_map``."""
    aval: Any = jax.typeof(leaf)
    return aval.mat.varying if hasattr(aval, "mat") else aval.vma  # 0.12, 0.10


def alike(values: Any) -> Any:
    """Make the arrays of a pytree vary over the same axes of a mesh.

    JAX refuses loops whose state is equal on all devices at first and differs later.
    """
    axes = frozenset[Any]().union(*map(varying, jax.tree.leaves(values)))

    def of_leaf(leaf: Any) -> Any:
        missing = tuple(axes - varying(leaf))
        return jax.lax.pcast(leaf, missing, to="varying") if missing else leaf

    return jax.tree.map(of_leaf, values)
