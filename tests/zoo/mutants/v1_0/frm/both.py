"""Mutants that break FRM at either end: in what client and server have in common."""

from typing import Any

from splatbus_wire import framing, packet_reader
from splatbus_wire.errors import FramingError
from splatbus_wire.framing import PacketDecoder

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import wire
from tests.zoo.faults.surgery import counts_each_byte, packets
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.jsn.servers import trusts_its_scene

NEVER = 600.0
LONGEST = framing.MAX_PAYLOAD_BYTES


@mutant("FRM-2", code="out-of-range", both=True)
def empty_packets(patch: Patch) -> None:
    """Sends an empty packet after each message, to keep the connection alive."""
    trusts_its_scene(patch)
    packets(patch, lambda packet: packet + bytes(4))


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def deaf_after_a_bad_length(patch: Patch) -> None:
    """Keeps the connection after a bad length, and hears nothing more on it."""

    def next_packet(original: Any, decoder: PacketDecoder) -> bytes | None:
        try:
            payload: bytes | None = original(decoder)
        except FramingError:
            return None
        return payload

    wire.NEXT_PACKET.wrap(patch, next_packet)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def empty_packets_are_skipped(patch: Patch) -> None:
    """Takes a length of 0 for a packet that says nothing."""
    Seam(framing, "MIN_PAYLOAD_BYTES").replace(patch, 0)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def any_length_is_waited_for(patch: Patch) -> None:
    """Waits for as many bytes as any header announces."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, 1 << 32)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def a_byte_too_many_is_taken(patch: Patch) -> None:
    """Takes payloads that are a byte longer than any may be."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, LONGEST + 1)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def trusts_whom_it_has_heard(patch: Patch) -> None:
    """Looks at the first length on a connection, and passes over bad ones that come later."""

    def receive(original: Any, self: PacketDecoder, data: bytes) -> None:
        length = int.from_bytes(data[:4], "little")
        bad = not 1 <= length <= LONGEST
        if not (bad and self.offset and not self.unfinished):
            original(self, data)

    wire.RECEIVES_BYTES.wrap(patch, receive)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", both=True)
def one_packet_per_read(patch: Patch) -> None:
    """Takes what one `recv` returned for one packet."""

    def receive(original: Any, decoder: PacketDecoder, data: bytes) -> None:
        if len(data) < 4 or len(data) != 4 + int.from_bytes(data[:4], "little"):
            return
        original(decoder, data)

    wire.RECEIVES_BYTES.wrap(patch, receive)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", both=True)
def drops_what_follows_a_packet(patch: Patch) -> None:
    """Handles the first packet that a read completes, and drops what came with it."""

    def next_packet(original: Any, decoder: PacketDecoder) -> bytes | None:
        payload: bytes | None = original(decoder)
        if payload is not None:
            decoder.payloads.clear()
            decoder.unfinished.clear()
        return payload

    wire.NEXT_PACKET.wrap(patch, next_packet)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", both=True)
def decodes_each_piece_by_itself(patch: Patch) -> None:
    """Decodes what each read brings of a payload, and loses what ends inside a character."""

    def receive(original: Any, decoder: PacketDecoder, data: bytes) -> None:
        begun = decoder.unfinished
        if len(begun) >= 4:
            rest = 4 + int.from_bytes(begun[:4], "little") - len(begun)
            try:
                data[:rest].decode()
            except UnicodeDecodeError:
                data = bytes(len(data[:rest])) + data[rest:]
        original(decoder, data)

    wire.RECEIVES_BYTES.wrap(patch, receive)


@mutant("FRM-5", check="check_incomplete_packet_is_given_up", code="hangs", both=True)
def each_byte_gives_a_packet_more_time(patch: Patch) -> None:
    """Begins to count anew with each byte of a packet."""
    counts_each_byte(patch)


@mutant("FRM-5", check="check_incomplete_packet_is_given_up", code="hangs", both=True)
def waits_for_the_rest_of_a_packet(patch: Patch) -> None:
    """Waits for ever for the rest of a packet."""
    Seam(packet_reader, "COMPLETION_SECONDS").replace(patch, NEVER)
