"""The reference client's adapter with a defect: `python -m tests.gpu.broken_client NAME`."""

from __future__ import annotations

import sys
import time
from typing import Any

from splatbus_client.cuda import images, legacy
from splatbus_client.cuda.driver import Device, api, call
from splatbus_viewer import adapter


def waits_for_no_event() -> None:
    def without_waits(function: Any, *arguments: Any) -> Any:
        return None if function is api.cuStreamWaitEvent else call(function, *arguments)

    images.call = legacy.call = without_waits


def reads_the_next_slot() -> None:
    for name in ("color", "depth"):
        right = getattr(images.CudaImages, name)

        def wrong(self: Any, slot: int, right: Any = right) -> Any:
            return right(self, (slot + 1) % self._ring.slots)

        setattr(images.CudaImages, name, wrong)


def reads_beside_the_image() -> None:
    right = images.CudaImages._array

    def wrong(self: Any, slot: int, offset: int, channels: tuple[int, ...]) -> Any:
        return right(self, slot, offset + 16, channels)

    images.CudaImages._array = wrong  # type: ignore[method-assign]


def ignores_the_device() -> None:
    api.cuInit(0)
    images.device = legacy.device = lambda uuid: Device(0)
    legacy.numbered = lambda ordinal: Device(0)


def releases_too_early() -> None:
    from splatbus_client.lease import FrameLease

    for reading in ("_host", "copy"):
        right = getattr(FrameLease, reading)

        def late(self: Any, *of: Any, right: Any = right) -> Any:
            if not self._released:
                self._released = True
                self._give_back()
            time.sleep(0.05)
            return right(self, *of)

        setattr(FrameLease, reading, late)
    FrameLease._readable = lambda self, image, name: image  # type: ignore[method-assign]
    FrameLease.intact = True  # type: ignore[assignment, method-assign]


DEFECTS = {
    "no-wait": waits_for_no_event,
    "next-slot": reads_the_next_slot,
    "beside": reads_beside_the_image,
    "any-device": ignores_the_device,
    "too-early": releases_too_early,
}

if __name__ == "__main__":
    DEFECTS[sys.argv.pop(1)]()
    adapter.main([])
