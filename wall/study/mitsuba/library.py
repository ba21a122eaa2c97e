"""Where Mitsuba finds LLVM."""

from __future__ import annotations

import os
from pathlib import Path

LLVM_FOLDERS = ("/usr/lib/x86_64-linux-gnu", "/usr/lib/llvm-19/lib", "/usr/lib64", "/usr/local/lib")
OLDEST_LLVM, NEWEST_LLVM = 17, 30


def libllvm() -> str | None:
    """The LLVM library that Mitsuba is told to use; None: there is no usable one."""
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return os.environ["DRJIT_LIBLLVM_PATH"]
    for folder in LLVM_FOLDERS:
        for number in range(NEWEST_LLVM, OLDEST_LLVM - 1, -1):
            for name in (f"libLLVM.so.{number}.1", f"libLLVM-{number}.so", f"libLLVM-{number}.so.1"):
                if (Path(folder) / name).exists():
                    return str(Path(folder) / name)
    return None
