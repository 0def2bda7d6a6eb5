"""The context, which holds all memory that the library's calls use."""

from __future__ import annotations

import ctypes
import threading
from typing import Any, Optional

import numpy as np

from . import _abi
from .enums import Kernels


class Context:
    """tv_context in memory that Python owns.

    max_width, max_height: the largest image, pixels. max_keypoints: the most descriptors of an
    image. max_matches: the most matches of an estimate; 0 means max_keypoints. kernels: a Kernels.
    max_effort: the highest rung of effort, 0 to 3, to which reconstruct climbs. purposes: bits of
    Purpose for the calls that get memory, 0 for all; another call raises TV_ERR_LIMITS. library: a
    Library in place of the package's own. Calls from several threads wait for each other; use one
    context for each thread to run them at once. close() or a with statement frees the memory; later
    calls raise ValueError.
    Raises TV_ERR_ARGUMENT for a limit out of its range, TV_ERR_KERNELS for kernels that this CPU
    does not have, ImportError where there is no library."""

    def __init__(self, *, max_width: int = 640, max_height: int = 480, max_keypoints: int = 2048,
                 max_matches: int = 0, kernels: int = Kernels.AUTO,
                 purposes: int = 0, library: Optional[_abi.Library] = None, max_effort: int = 0):
        self.library = library or _abi.default_library()
        limits = self.library.make(_abi.tv_limits, {
            "max_width": max_width, "max_height": max_height, "max_keypoints": max_keypoints,
            "max_matches": max_matches, "kernels": kernels, "purposes": purposes,
            "max_effort": max_effort})
        size = ctypes.c_size_t()
        self.library.call("tv_context_size", ctypes.byref(limits), ctypes.byref(size))
        self._memory: Optional[np.ndarray] = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
        start = -self._memory.ctypes.data % _abi.CONTEXT_ALIGNMENT
        self._pointer = ctypes.c_void_p()
        self.library.call("tv_context_init", ctypes.byref(self._pointer), ctypes.byref(limits),
                          ctypes.c_void_p(self._memory.ctypes.data + start), size)
        self.lock = threading.RLock()
        self.size_bytes = size.value
        self.max_keypoints = int(limits.max_keypoints)
        self.max_effort = int(limits.max_effort)

    def __enter__(self) -> Context:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Frees the memory. Calls after it raise ValueError; closing twice is allowed."""
        with self.lock:
            self._memory = None
            self._pointer = ctypes.c_void_p()

    def call(self, function: str, *arguments: Any) -> None:
        """Calls a C function whose first argument is the context."""
        with self.lock:
            if self._memory is None:
                raise ValueError(f"{function}: the context is closed")
            self.library.call(function, self._pointer, *arguments)

    @property
    def kernels(self) -> Kernels:
        """The instruction-set kernels that this context uses (tv_context_kernels)."""
        with self.lock:
            return Kernels(self.library.lib.tv_context_kernels(self._pointer))

    @property
    def high_water(self) -> int:
        """The largest number of bytes that any call so far has used (tv_context_high_water)."""
        with self.lock:
            return int(self.library.lib.tv_context_high_water(self._pointer))


def check_context(context: Any) -> Context:
    if not isinstance(context, Context):
        raise TypeError(f"context: a twoview.Context is expected, not {type(context).__name__}")
    return context
