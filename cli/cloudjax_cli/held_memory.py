"""What a process that does many tasks holds: compiled functions, until they are many.

Scenes of another structure are compiled anew, and what was compiled stays. A function
takes pieces of mapped memory, of which Linux allows a process 65 530: at the next one
the compiler ends the process.
"""

import gc
from pathlib import Path


# Pieces of mapped memory; some scenes of as many structures fill the rest.
MANY_MAPS = 30_000


def forget_if_much() -> bool:
    """Forget what has been compiled where it is much, and say whether it was."""
    if _maps() <= MANY_MAPS:
        return False
    import equinox as eqx
    import jax

    from cloudjax_fit.solver import forget_compiled

    forget_compiled()
    eqx.clear_caches()
    jax.clear_caches()
    gc.collect()
    return True


def _maps() -> int:
    """Those of this process; none where the system does not tell."""
    try:
        return Path("/proc/self/maps").read_bytes().count(b"\n")
    except OSError:
        return 0
