"""Where LLVM is, which Dr.Jit loads when it is first used."""

import glob
import os


PLACES = (
    "/usr/lib/llvm-19/lib/libLLVM*.so*",
    "/usr/lib/*-linux-gnu/libLLVM.so.19*",
    "/usr/lib/*-linux-gnu/libLLVM-19.so*",
    "/usr/lib64/libLLVM.so.19*",
    "/opt/homebrew/opt/llvm@19/lib/libLLVM.dylib",
)


def find() -> str | None:
    """The library that DRJIT_LIBLLVM_PATH names, or LLVM 19 in a usual place."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    found = (path for place in PLACES for path in sorted(glob.glob(place)))
    return named or next(found, None)
