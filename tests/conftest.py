"""Strict promotion everywhere and two CPU devices, so that sharding can be tested without an accelerator."""

import jax

jax.config.update("jax_num_cpu_devices", 2)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")
