"""The stand-in as a run of the harness has it: library, device, trace, and a testee's variables."""

import os

from splatbus_conformance import guard
from splatbus_conformance.images.memory.cuda_stand_in.building import library_folder
from splatbus_conformance.images.memory.cuda_stand_in.device import StandInDevice
from splatbus_conformance.images.memory.cuda_stand_in.trace import Call, Trace

DEVICES = 2
"""So that it shows whether a client heeds `meta.device`."""

SLOW_RECORDS = {"SPLATBUS_STAND_IN_SLOW": "1"}
"""A variable with which `cudaEventRecord` takes 5 ms: what a program does before it is parted from
what it does afterwards."""


class StandIn:
    """Everything that one testee needs to meet the stand-in, and what it did there.

    Raises NotAvailable where the library cannot be had.
    """

    def __init__(self) -> None:
        self._library = library_folder()
        self.device = StandInDevice()
        self._folder = guard.folder("splatbus-trace-")
        self._trace = Trace(self._folder / "calls.jsonl")

    def environment(self) -> dict[str, str]:
        """The variables by which a testee finds the library, and the library the device."""
        before = os.environ.get("LD_LIBRARY_PATH")
        return {
            "LD_LIBRARY_PATH": os.pathsep.join(filter(None, (str(self._library), before))),
            "SPLATBUS_STAND_IN_DEVICE": str(self.device.folder),
            "SPLATBUS_STAND_IN_DEVICES": str(DEVICES),
            "SPLATBUS_STAND_IN_TRACE": str(self._trace.path),
        }

    def calls(self) -> list[Call]:
        """Every call that testees have made until now."""
        return self._trace.calls()

    def close(self) -> None:
        """Free the device, remove the trace."""
        self.device.close()
        guard.remove(self._folder)
