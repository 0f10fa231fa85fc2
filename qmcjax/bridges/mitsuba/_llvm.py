"""Import of Mitsuba, and a check of its LLVM variants."""

import subprocess
import sys
from types import ModuleType

_TRIAL = """
import drjit, mitsuba
mitsuba.set_variant("llvm_ad_rgb")
print(*drjit.detail.llvm_version(), sep=".", flush=True)
film = {"type": "hdrfilm", "width": 2, "height": 2}
scene = {
    "type": "scene",
    "integrator": {"type": "direct"},
    "sensor": {"type": "perspective", "film": film},
    "ball": {"type": "sphere"},
    "sky": {"type": "constant"},
}
drjit.eval(mitsuba.render(mitsuba.load_dict(scene), spp=1))
drjit.sync_thread()
"""


def check_llvm() -> str:
    """Return the version of LLVM that Mitsuba finds; raise unless its LLVM variants render with it.

    Some versions abort the whole process at the first image: LLVM 14 to 16 did on a processor with AVX-512,
    19 works. So this renders four pixels in a separate process, which takes a second or two.

    Returns
    -------
    str, such as "19.1.7"

    Raises
    ------
    ImportError
        If Mitsuba is not installed.
    RuntimeError
        If there is no LLVM, or it does not work.
    """
    imported()
    trial = subprocess.run([sys.executable, "-c", _TRIAL], capture_output=True, text=True)
    version = trial.stdout.strip()
    if trial.returncode:
        found = f"LLVM {version} aborts" if version else "no LLVM is found"
        last = (trial.stderr.strip().splitlines() or [""])[-1]
        raise RuntimeError(
            f"{found} (code {trial.returncode}: {last}). Mitsuba's LLVM variants need LLVM 19 (Debian: "
            "libllvm19); set DRJIT_LIBLLVM_PATH to the path of libLLVM.so if there are several"
        )
    return version


def imported() -> ModuleType:
    """Return Mitsuba, or raise an ImportError that says how to install it."""
    try:
        import mitsuba  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise ImportError("Mitsuba 3 is not installed: pip install 'qmcjax[mitsuba]'") from error
    return mitsuba
