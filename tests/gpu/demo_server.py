"""The reference server's scene in memory of a GPU: `python -m tests.gpu.demo_server [BROKEN]`.

With the name of a defect it has that.
"""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np
import splatbus_server
from splatbus_renderer.demo import render_until
from splatbus_server.cuda.driver import Device

from tests.gpu.images import OnDevice

SIZE = (320, 240)


class Uploading:
    """A bus that takes images of the host."""

    def __init__(self, bus: Any, flips: bool) -> None:
        self._bus, self._flips = bus, flips

    def __getattr__(self, name: str) -> Any:
        return getattr(self._bus, name)

    def publish(self, view: Any, color: Any, depth: Any = None, **others: Any) -> None:
        arrays = [None if it is None else np.asarray(it, np.float32) for it in (color, depth)]
        if self._flips:
            arrays = [it if it is None else it[::-1] for it in arrays]
        self._bus.publish(view, *(it if it is None else OnDevice(it) for it in arrays), **others)


def names_another_device() -> None:
    Device.uuid = property(  # type: ignore[assignment]
        lambda self: "GPU-00000000-0000-4000-8000-00000000dead", lambda self, value: None
    )


DEFECTS = {"another-device": names_another_device}


def main() -> None:
    sys.setswitchinterval(0.0005)
    defect = sys.argv[1] if sys.argv[1:] else ""
    DEFECTS.get(defect, lambda: None)()
    with (
        splatbus_server.serve(*SIZE, memory="cuda_ipc") as bus,
        Device(0).current(),
    ):
        render_until(threading.Event(), Uploading(bus, defect == "upside-down"))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
