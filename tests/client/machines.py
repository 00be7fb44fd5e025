"""The machines of both channels, brought to where a test begins."""

from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.messages import Hello, Program

from tests.peers.fake_server import (
    IPC_CAPABILITIES,
    MESSAGE_CAPABILITIES,
    init_packet,
    welcome,
)
from tests.peers.raw_client import packet, packets

PROGRAM = Program("test", "0")
IPC_HELLO = Hello(("1.1", "1.0"), PROGRAM, IPC_CAPABILITIES)
MESSAGE_HELLO = Hello(("1.1", "1.0"), PROGRAM, MESSAGE_CAPABILITIES)
BOTH, COLOR = frozenset({"color", "depth"}), frozenset({"color"})
SIZE = {"viewport_size": [320, 240]}
TYPED_SIZE = {"type": "viewport_size"} | SIZE


def receive(machine, *messages, now=0.0):
    """The events of what a server sends."""
    return list(machine.receive(b"".join(map(packet, messages)), now))


def sent(machine, now=0.0):
    """What the machine has to say."""
    return packets(machine.data_to_send(now))


def ipc(channels=BOTH):
    """A machine that has said hello."""
    machine = IpcProtocol(IPC_HELLO, channels)
    machine.data_to_send(0.0)
    return machine


def greeted(*capabilities, channels=BOTH):
    """A machine that has been welcomed."""
    machine = ipc(channels)
    receive(machine, welcome(*(capabilities or IPC_CAPABILITIES)))
    return machine


def opened(*capabilities, channels=BOTH):
    """A machine that has opened generation 1."""
    machine = greeted(*capabilities, channels=channels)
    (event,) = receive(machine, init_packet())
    machine.opened(event.packet)
    machine.data_to_send(0.0)
    return machine


def message():
    """A machine that has said hello, and asked what tells versions apart."""
    machine = MessageProtocol(MESSAGE_HELLO)
    machine.data_to_send(0.0)
    return machine


def of_1_0():
    """A machine that knows that its server speaks 1.0."""
    machine = message()
    receive(machine, SIZE)
    return machine


def of_1_1(*capabilities):
    """A machine that has been welcomed to 1.1, and told the size."""
    machine = message()
    receive(machine, welcome(*capabilities), TYPED_SIZE)
    return machine
