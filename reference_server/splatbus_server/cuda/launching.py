"""A kernel with the record of its event behind it, prepared: a frame costs the host two calls.

By the driver's own functions: through a wrapper that turns each argument into an object first, and
with the parameters packed anew, the same takes several times as long, and a 720p image is on its
way for 15 µs only.
"""

from __future__ import annotations

import ctypes
import sys
from ctypes import byref, c_float, c_int64, c_uint, c_void_p

from splatbus_server.cuda.driver import api, refused
from splatbus_server.cuda.kernels import THREADS
from splatbus_server.cuda.source import Layout

# The driver is loaded already, by cuda-bindings.
_library = ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
launch, record = _library.cuLaunchKernelEx, _library.cuEventRecord


def current_context() -> int | None:
    """The handle of the context that is this thread's, if there is one."""
    found = c_void_p()
    if status := _library.cuCtxGetCurrent(byref(found)):
        raise refused("cuCtxGetCurrent", api.CUresult(status))
    return found.value


class _Image(ctypes.Structure):
    """The kernels' parameter, as publish.cu declares it."""

    _fields_ = (
        *(("color", c_void_p), ("color_row", c_int64), ("color_column", c_int64)),
        ("channel", c_int64),
        *(("depth", c_void_p), ("depth_row", c_int64), ("depth_column", c_int64)),
        *(("alpha", c_void_p), ("alpha_row", c_int64), ("alpha_column", c_int64)),
        *(("slot_color", c_void_p), ("slot_depth", c_void_p)),
        *(("width", c_uint), ("height", c_uint), ("empty", c_float)),
    )


class _Config(ctypes.Structure):
    """CUlaunchConfig of cuda.h."""

    _fields_ = (
        *((name, c_uint) for name in ("grid_x", "grid_y", "grid_z")),
        *((name, c_uint) for name in ("block_x", "block_y", "block_z")),
        *(("shared_bytes", c_uint), ("stream", c_void_p)),
        *(("attributes", c_void_p), ("attribute_count", c_uint)),
    )


class Launch:
    """Of one kernel into one slot on one stream, for images that lie alike."""

    def __init__(
        self,
        kernel: int,
        layout: Layout,
        slot: tuple[int, int],
        size: tuple[int, int],
        empty: float,
        stream: int,
        event: int,
    ) -> None:
        """Prepares it.

        Args:
            kernel: of the driver.
            layout: of the source.
            slot: pointers to its colour and its depth.
            size: width and height in pixels.
            empty: depth where nothing is.
            stream: to work on.
            event: to record behind it.
        """
        width, height = size
        blocks = -(-width * height // THREADS)
        self._image = _Image(
            *(None, *layout.color, None, *layout.depth, None, *layout.alpha),
            *(*slot, width, height, empty),
        )
        self._config = _Config(blocks, 1, 1, THREADS, 1, 1, 0, stream, None, 0)
        self._parameters = (c_void_p * 1)(ctypes.addressof(self._image))
        self._arguments = (
            c_void_p(ctypes.addressof(self._config)),
            c_void_p(kernel),
            c_void_p(ctypes.addressof(self._parameters)),
            None,
        )
        self._record = c_void_p(event), c_void_p(stream)

    def __call__(self, color: int, depth: int, alpha: int) -> None:
        """Fills the slot from these addresses, and records its event behind that [IMG-7, BUF-10].

        Raises:
            CudaError: the driver refuses.
        """
        image = self._image
        image.color, image.depth, image.alpha = color, depth, alpha
        if status := launch(*self._arguments):
            raise refused("cuLaunchKernelEx", api.CUresult(status))
        if status := record(*self._record):
            raise refused("cuEventRecord", api.CUresult(status))
