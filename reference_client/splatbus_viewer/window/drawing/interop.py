"""Textures that take each image from memory of a GPU, by graphics interoperability of CUDA."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import moderngl
from splatbus_client.cuda.driver import CudaError, api, call, numbered
from splatbus_client.lease import FrameLease, OnDevice

from splatbus_viewer.window.drawing.uploading import CHANNELS, texture

_TEXTURE_2D = 0x0DE1
_DISCARDED = 2  # CU_GRAPHICS_REGISTER_FLAGS_WRITE_DISCARD
_NON_BLOCKING = 1


class Interop:
    """Textures that CUDA copies to; nothing of an image passes through the host."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        self.color = texture(context, width, height, "color")
        self.depth = texture(context, width, height, "depth")
        self._size = width, height
        self._stream: Any = None
        self._current = ExitStack()  # the device's context, on the thread that draws
        self._copies: dict[str, tuple[Any, Any]] = {}

    def take(self, lease: FrameLease) -> int:
        """Copy the channels that are subscribed to, on the GPU; returns how many bytes.

        The copies are seen to finish when the frame is released.

        Raises:
            OSError: OpenGL draws on another device than the one that images lie on.
        """
        images = {
            name: lease.color_on_device if name == "color" else lease.depth_on_device
            for name in sorted(lease.channels)
        }
        if self._stream is None:
            self._begin(next(iter(images.values())))
        return sum(self._copy(name, image) for name, image in images.items())

    def release(self) -> None:
        """Give back textures, and what CUDA knows of them."""
        if self._stream is not None:
            for resource, _ in self._copies.values():
                call(api.cuGraphicsUnregisterResource, resource)
            call(api.cuStreamDestroy, self._stream)
        self._current.close()
        self.color.release()
        self.depth.release()

    def _begin(self, image: OnDevice) -> None:
        _, ordinal = image.__dlpack_device__()
        self._current.enter_context(numbered(ordinal).current())
        self._stream = call(api.cuStreamCreate, _NON_BLOCKING)

    def _copy(self, name: str, image: OnDevice) -> int:
        if name not in self._copies:
            self._copies[name] = self._registered(name)
        resource, copy = self._copies[name]
        call(api.cuGraphicsMapResources, 1, resource, self._stream)
        try:
            copy.srcDevice = image.ready_on(int(self._stream))
            copy.dstArray = call(api.cuGraphicsSubResourceGetMappedArray, resource, 0, 0)
            call(api.cuMemcpy2DAsync, copy, self._stream)
        finally:
            call(api.cuGraphicsUnmapResources, 1, resource, self._stream)
        return int(copy.WidthInBytes * copy.Height)

    def _registered(self, name: str) -> tuple[Any, Any]:
        """A texture as CUDA knows it, and the copy to it, but for what changes."""
        width, height = self._size
        number = (self.color if name == "color" else self.depth).glo
        try:
            resource = call(api.cuGraphicsGLRegisterImage, number, _TEXTURE_2D, _DISCARDED)
        except CudaError as problem:
            hint = "does OpenGL draw on the GPU that the images lie on?"
            raise OSError(f"{problem}; {hint}") from None
        copy = api.CUDA_MEMCPY2D()
        copy.srcMemoryType = api.CUmemorytype.CU_MEMORYTYPE_DEVICE
        copy.dstMemoryType = api.CUmemorytype.CU_MEMORYTYPE_ARRAY
        copy.srcPitch = copy.WidthInBytes = 4 * CHANNELS[name] * width
        copy.Height = height
        return resource, copy
