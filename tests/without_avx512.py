"""Run Python as on a processor without AVX-512: ``python tests/without_avx512.py -m pytest``.

Vectors of another width add numbers in another order, and vector instructions round functions otherwise.
"""

import os
import sys

from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

if __name__ == "__main__":
    # NumPy warns of other names than those that it would use here.
    able = [name for name in __cpu_dispatch__ if __cpu_features__[name]]
    wide = [name for name in able if "512" in name or name == "X86_V4"]
    more = {"NPY_DISABLE_CPU_FEATURES": " ".join(wide)} if wide else {}
    # Where it is set, OpenBLAS may crash with another kernel.
    if wide and "OPENBLAS_CORETYPE" not in os.environ:
        more["OPENBLAS_CORETYPE"] = "Haswell"
    more["XLA_FLAGS"] = f"--xla_cpu_max_isa=AVX2 {os.environ.get('XLA_FLAGS', '')}".strip()
    os.execve(sys.executable, [sys.executable, *sys.argv[1:]], os.environ | more)
