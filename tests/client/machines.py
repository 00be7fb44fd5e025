"""Machines of the message channel that have come to know what their server speaks."""

from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.messages import Hello, Program

from tests.peers.fake_server import MESSAGE_CAPABILITIES, welcome
from tests.peers.raw_client import packet

HELLO = Hello(("1.1", "1.0"), Program("test", "0"), MESSAGE_CAPABILITIES)
SIZE = {"viewport_size": [320, 240]}


def receive(machine, data, now):
    return list(machine.receive(data, now))


def machine_of_1_0():
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    receive(machine, packet(SIZE), 0.0)
    return machine


def machine_of_1_1(*capabilities):
    machine = MessageProtocol(HELLO)
    machine.data_to_send(0.0)
    receive(machine, packet(welcome(*capabilities)), 0.0)
    receive(machine, packet({"type": "viewport_size"} | SIZE), 0.0)
    return machine
