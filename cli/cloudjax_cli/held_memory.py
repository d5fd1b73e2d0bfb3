"""What a process that does many tasks holds: compiled functions, until they are many.

Scenes of another structure are compiled anew, and what was compiled stays. A function
takes pieces of mapped memory, of which Linux allows a process 65 530: at the next one
the compiler ends the process.
"""

import ctypes
import gc
import sys
from pathlib import Path


# Pieces of mapped memory; some scenes of as many structures fill the rest.
MANY_MAPS = 30_000


def forget_if_much() -> bool:
    """Forget what has been compiled where it is much, and say whether it was."""
    if maps() <= MANY_MAPS:
        return False
    forget()
    return True


def forget() -> None:
    """Forget what has been compiled, and give its memory back to the system."""
    import equinox as eqx
    import jax

    solver = sys.modules.get("cloudjax_fit.solver")
    if solver is not None:
        solver.forget_compiled()
    eqx.clear_caches()
    jax.clear_caches()
    gc.collect()
    # What is freed in small pieces glibc keeps for itself, which is half of all.
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def maps() -> int:
    """Those of this process; none where the system does not tell."""
    try:
        return Path("/proc/self/maps").read_bytes().count(b"\n")
    except OSError:
        return 0
