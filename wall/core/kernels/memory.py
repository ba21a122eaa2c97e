"""Functions that C calls back, and numbers in memory that C points to; by ctypes where JIT is disabled."""

from __future__ import annotations

import ctypes

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from wall.core.jit import c_callback

_kept: list[object] = []  # callbacks live as long as the process


def callback(function):
    """Address of a C function `void f(void *)`, compiled from a pure function of that pointer's address."""
    if numba.config.DISABLE_JIT:
        made = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(function)
        _kept.append(made)
        return ctypes.cast(made, ctypes.c_void_p).value
    made = c_callback(types.void(types.intp), function)
    _kept.append(made)
    return made.address


def _loader(dtype):
    """A function of address and index k: the k-th number of a type in the memory at an address."""
    if numba.config.DISABLE_JIT:
        ctype = np.ctypeslib.as_ctypes_type(dtype)
        return lambda address, k: dtype(ctype.from_address(int(address) + int(k) * ctypes.sizeof(ctype)).value)
    kind = numba.from_dtype(np.dtype(dtype))

    @intrinsic
    def load(_context, address, k):
        def code(context, builder, _signature, arguments):
            pointer = builder.inttoptr(arguments[0], context.get_value_type(kind).as_pointer())
            return builder.load(builder.gep(pointer, [arguments[1]]))

        return kind(types.intp, types.intp), code

    return load


uint8_at, uint32_at, int64_at, float32_at = (_loader(dtype) for dtype in (np.uint8, np.uint32, np.int64, np.float32))

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]

    def clear_uint32(address, k):
        """Sets the k-th uint32 in the memory at an address to 0."""
        ctypes.c_uint32.from_address(int(address) + 4 * int(k)).value = 0

else:

    @intrinsic
    def clear_uint32(_context, address, k):
        """Sets the k-th uint32 in the memory at an address to 0."""

        def code(_context, builder, _signature, arguments):
            number = ir.IntType(32)
            pointer = builder.inttoptr(arguments[0], number.as_pointer())
            builder.store(number(0), builder.gep(pointer, [arguments[1]]))

        return types.void(types.intp, types.intp), code
