"""An IPC machine brought to where a test begins."""

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire.messages import Hello, Program

from tests.peers.fake_server import IPC_CAPABILITIES, init_packet, welcome
from tests.peers.raw_client import packet, packets

HELLO = Hello(("1.1", "1.0"), Program("test", "0"), IPC_CAPABILITIES)
BOTH = frozenset({"color", "depth"})
COLOR = frozenset({"color"})


def receive(machine, *messages):
    return list(machine.receive(b"".join(map(packet, messages)), 0.0))


def sent(machine):
    return packets(machine.data_to_send(0.0))


def greeted(*capabilities, channels=BOTH):
    """A machine that has said hello and been welcomed."""
    machine = IpcProtocol(HELLO, channels)
    machine.data_to_send(0.0)
    receive(machine, welcome(*(capabilities or IPC_CAPABILITIES)))
    return machine


def opened(*capabilities, **init_members):
    """A machine that has opened generation 1."""
    machine = greeted(*capabilities)
    (event,) = receive(machine, init_packet(**init_members))
    machine.opened(event.packet)
    machine.data_to_send(0.0)
    return machine
