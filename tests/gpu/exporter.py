"""A process that shares memory on a GPU and waits: prints its init packet first."""

import json
import sys

from splatbus_server.cuda.driver import Device
from splatbus_server.cuda.memory import DeviceMemory
from splatbus_wire.init_packet import init_packet_object
from splatbus_wire.semantics import Semantics

if __name__ == "__main__":
    memory = DeviceMemory(16, 8, 1, Semantics(), Device(0))
    print(json.dumps(init_packet_object(memory.init_packet)), flush=True)
    sys.stdin.read()
