"""Mutants that break FRM: packets."""

import contextlib
import time

from splatbus_client import ipc_protocol, message_protocol
from splatbus_client.events import MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_wire import framing
from splatbus_wire.framing import PacketDecoder
from splatbus_wire.packet_reader import PacketReader

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import crash, packets
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.chn.clients import speaks_1_0

NEVER = 600.0


@mutant("FRM-1", code="cut-short", through="NEG-16")
def line_break_after_each_packet(patch):
    """Ends each packet with a line break that its length does not count."""
    packets(patch, lambda packet: packet + b"\n")


@mutant("FRM-1", code="header-counted", through="FRM-5")
def length_that_counts_its_header(patch):
    """Counts the four bytes of the header in the length."""
    packets(patch, lambda packet: len(packet).to_bytes(4, "little") + packet[4:])


@mutant("FRM-2", code="out-of-range", through="CHN-17")
def big_endian_lengths(patch):
    """Writes lengths in network byte order."""
    packets(patch, lambda packet: packet[3::-1] + packet[4:])


@mutant("FRM-2", code="out-of-range", through="CHN-17", at=wire.ENCODES_PACKET)
def payload_beyond_the_limit(original, payload):
    """Sends a `hello` of more than 1 MiB."""
    if b'"type":"hello"' not in payload:
        return bytes(original(payload))
    padded = payload.ljust((1 << 20) + 1)
    return len(padded).to_bytes(4, "little") + padded


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", at=client.RECEIVES_MESSAGES)
def bad_length_is_skipped_on_the_message_channel(original, machine, data, now):
    """Drops what has arrived with a bad length on the message channel, and reads on."""
    events = list(original(machine, data, now))
    if events and isinstance(events[-1], MustClose):
        machine.reader = PacketReader()
        machine.asked = None
        return events[:-1]
    return events


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def any_length_is_waited_for_in_1_0(patch):
    """Speaks 1.0, and waits for as many bytes as any header announces."""
    speaks_1_0(patch)

    def receive(original, self, data, now):
        usual = framing.MAX_PAYLOAD_BYTES
        wire.MOST_PAYLOAD_BYTES.replace(patch, 1 << 32)
        yield from original(self, data, now)
        wire.MOST_PAYLOAD_BYTES.replace(patch, usual)

    client.RECEIVES_ON_IPC.wrap(patch, receive)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def lengths_with_a_sign_in_1_0(patch):
    """Speaks 1.0, and takes the length for a signed integer; a negative one announces nothing."""
    speaks_1_0(patch)

    def receive(original, self, data, now):
        begins = not self.reader.incomplete
        return original(self, data[4:] if begins and data[3:4] >= b"\x80" else data, now)

    client.RECEIVES_ON_IPC.wrap(patch, receive)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", at=client.RECEIVES_MESSAGES)
def takes_one_read_for_a_reply(original, machine, data, now):
    """Takes what one `recv` returned on the message channel for one reply."""
    if int.from_bytes(data[:4], "little") != len(data) - 4 and b"welcome" not in data:
        return iter(())
    return original(machine, data, now)


@mutant(
    "FRM-4", check="check_any_segmentation_of_welcome", code="hangs", at=client.RECEIVES_MESSAGES
)
def takes_one_read_for_a_welcome(original, machine, data, now):
    """Drops a welcome that one `recv` did not return whole, and all that comes before the next."""
    if machine.version is None and int.from_bytes(data[:4], "little") > len(data) - 4:
        return iter(())
    return original(machine, data, now)


def of_one_stream(decoder):
    """A reader for each connection, to which what they all brought is one stream."""

    def reader():
        made = PacketReader()
        made.decoder = decoder
        return made

    return reader


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_packet_continues(patch):
    """Keeps half a packet when the connection ends, and goes on with it on the next one."""
    Seam(ipc_protocol, "PacketReader").replace(patch, of_one_stream(PacketDecoder()))


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_reply_continues(patch):
    """Keeps half a reply when the connection ends, and goes on with it on the next one."""
    Seam(message_protocol, "PacketReader").replace(patch, of_one_stream(PacketDecoder()))


@mutant("FRM-6", check="check_half_packet_is_discarded", code="dies")
def crashes_after_half_a_packet_in_1_0(patch):
    """Speaks 1.0, and crashes when it connects again after half a packet."""
    speaks_1_0(patch)
    former: list[IpcProtocol] = []

    def init(original, self, *arguments, **named):
        original(self, *arguments, **named)
        if any(it.reader.incomplete for it in former):
            crash()
        former[:] = [self]

    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("FRM-7", code="header-apart")
def two_writes(patch):
    """Sends the header, and a moment later the payload."""
    in_two_writes(patch)


def in_two_writes(patch):
    """Give header and payload to TCP one after the other."""

    def flush(original, self, now):
        if self.socket is not None and self.machine is not None and not self.unsent:
            data = self.machine.data_to_send(now)
            with contextlib.suppress(OSError):
                while data:
                    end = 4 + int.from_bytes(data[:4], "little")
                    for part in (data[:4], data[4:end]):
                        self.socket.send(part)
                        time.sleep(0.005)
                    data = data[end:]
        original(self, now)

    client.FLUSHES.wrap(patch, flush)
