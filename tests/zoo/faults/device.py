"""Make of the reference server one whose images lie in memory of a GPU, put there by copies.

The reference fills that memory by kernels, and the stand-in runs none. Here is all that takes the
place of `splatbus_server.cuda.launching`, which launches them.
"""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from splatbus_server import source as images
from splatbus_server.cuda import source
from splatbus_server.cuda.driver import api, call
from splatbus_server.cuda.kernels import Compiler, Kernels
from splatbus_server.cuda.source import Layout
from splatbus_server.publish import Publisher

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import renderer, server

FILLS = Kernels(
    color_depth=(True, True),
    color_only=(True, False),
    depth_only=(False, True),
    legacy=(True, True),
)
"""Whether each kernel writes colour and depth."""
NUMBERED = Kernels(*range(len(FILLS)))
ALIKE = Layout(None, (0, 0, 0), (0, 0), (0, 0))  # type: ignore[arg-type]
"""How every image lies, as far as it matters here."""
STREAM = 0
"""The default one."""


class Launch:
    """In place of a kernel: converts an image as for memory of the host, and copies what it made.

    The event is recorded behind that.
    """

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
        width, height = size
        self._publisher = Publisher(width, height, empty)
        made = np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32)
        self._planes = [
            plane if fills else None for plane, fills in zip(made, FILLS[kernel], strict=True)
        ]
        self._slot, self.stream, self.event = slot, stream, event

    def __call__(self, image: images.Source, *_: object) -> None:
        """Fill the slot. Raises CudaError."""
        self._publisher.write(image, *self._planes)
        for place, plane in zip(self._slot, self._planes, strict=True):
            if plane is not None:
                self.copy(place, plane)
        self.record()

    def copy(self, place: int, plane: NDArray[np.float32]) -> None:
        """Copy colour, (h, w, 4), or depth, (h, w), to where it belongs."""
        call(api.cuMemcpyHtoDAsync, place, plane.ctypes.data, plane.nbytes, self.stream)

    def record(self) -> None:
        """Record the event."""
        call(api.cuEventRecord, self.event, self.stream)


PREPARES, COPIES, RECORDS = (Seam(Launch, name) for name in ("__init__", "copy", "record"))


def current_context() -> int | None:
    """The handle of the context that is this thread's, if there is one."""
    return int(call(api.cuCtxGetCurrent)) or None


def keeps_images_there(patch: Patch, *, lends: bool) -> None:
    """Keep images in memory of a GPU: those of 1.0 alone, or those that are lent as well.

    Before the server has imported what that takes.
    """

    def serve(original: Any, *size: int, **named: Any) -> Any:
        return original(*size, **named | {"memory": "cuda_ipc"})

    def look(_: Any, color: Any, depth: Any, alpha: Any, kind: Any, *__: Any, **of: Any) -> Any:
        size = of["width"], of["height"]
        image = images.source(color, depth, alpha, kind, *size, of["premultiplied"])
        return ALIKE, (image, depth is not None, 0), STREAM, []

    patch.setitem(sys.modules, "splatbus_server.cuda.launching", sys.modules[__name__])
    renderer.SERVES.wrap(patch, serve)
    Seam(Compiler, "kernels").wrap(patch, lambda original, self, wanted: NUMBERED)
    Seam(source, "source").wrap(patch, look)
    if not lends:
        server.CAPABILITIES_ON_IPC.replace(patch, ())
