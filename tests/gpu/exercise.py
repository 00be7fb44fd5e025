"""Every format of the kernel at awkward sizes: what compute-sanitizer looks at."""

from __future__ import annotations

from splatbus_server.cuda.driver import Device
from splatbus_server.cuda.kernels import Compiler
from splatbus_wire.semantics import Semantics

from tests.gpu.images import BOTH, FORMATS, OnDevice, arrays_of, memory


def main() -> None:
    device = Device(0)
    compiler = Compiler(device.capability)
    with device.current():
        for count, format in enumerate(FORMATS):
            size = [(7, 5), (1, 1), (257, 3), (1025, 2)][count % 4]
            given = arrays_of(format, size)
            arrays = [None if each is None else OnDevice(each) for each in given]
            ours = memory(size, device, compiler, Semantics(alpha=format["meaning"]))
            write = ours.writer(*arrays, format["kind"], None)
            for slot, wants in enumerate((BOTH | {"legacy"}, {"color"}, {"depth"})):
                write(slot, wants)
            ours.close()
    print(f"{len(FORMATS)} formats")


if __name__ == "__main__":
    main()
