"""Mutants that break FRM at either end: in what client and server have in common."""

from splatbus_wire import framing, packet_reader
from splatbus_wire.errors import FramingError

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import wire
from tests.zoo.faults.surgery import counts_each_byte, packets
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.jsn.servers import trusts_its_scene

NEVER = 600.0
LONGEST = framing.MAX_PAYLOAD_BYTES


@mutant("FRM-2", code="out-of-range", both=True)
def empty_packets(patch):
    """Sends an empty packet after each message, to keep the connection alive."""
    trusts_its_scene(patch)
    packets(patch, lambda packet: packet + bytes(4))


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True, at=wire.NEXT_PACKET)
def deaf_after_a_bad_length(original, decoder):
    """Keeps the connection after a bad length, and hears nothing more on it."""
    try:
        payload: bytes | None = original(decoder)
    except FramingError:
        return None
    return payload


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def empty_packets_are_skipped(patch):
    """Takes a length of 0 for a packet that says nothing."""
    Seam(framing, "MIN_PAYLOAD_BYTES").replace(patch, 0)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def any_length_is_waited_for(patch):
    """Waits for as many bytes as any header announces."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, 1 << 32)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True)
def a_byte_too_many_is_taken(patch):
    """Takes payloads that are a byte longer than any may be."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, LONGEST + 1)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", both=True, at=wire.RECEIVES_BYTES)
def trusts_whom_it_has_heard(original, self, data):
    """Looks at the first length on a connection, and passes over bad ones that come later."""
    length = int.from_bytes(data[:4], "little")
    bad = not 1 <= length <= LONGEST
    if not (bad and self.offset and not self.unfinished):
        original(self, data)


@mutant(
    "FRM-4", check="check_any_segmentation", code="not-taken", both=True, at=wire.RECEIVES_BYTES
)
def one_packet_per_read(original, decoder, data):
    """Takes what one `recv` returned for one packet."""
    if len(data) < 4 or len(data) != 4 + int.from_bytes(data[:4], "little"):
        return
    original(decoder, data)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", both=True, at=wire.NEXT_PACKET)
def drops_what_follows_a_packet(original, decoder):
    """Handles the first packet that a read completes, and drops what came with it."""
    payload: bytes | None = original(decoder)
    if payload is not None:
        decoder.payloads.clear()
        decoder.unfinished.clear()
    return payload


@mutant(
    "FRM-4", check="check_any_segmentation", code="not-taken", both=True, at=wire.RECEIVES_BYTES
)
def decodes_each_piece_by_itself(original, decoder, data):
    """Decodes what each read brings of a payload, and loses what ends inside a character."""
    begun = decoder.unfinished
    if len(begun) >= 4:
        rest = 4 + int.from_bytes(begun[:4], "little") - len(begun)
        try:
            data[:rest].decode()
        except UnicodeDecodeError:
            data = bytes(len(data[:rest])) + data[rest:]
    original(decoder, data)


@mutant("FRM-5", check="check_incomplete_packet_is_given_up", code="hangs", both=True)
def each_byte_gives_a_packet_more_time(patch):
    """Begins to count anew with each byte of a packet."""
    counts_each_byte(patch)


@mutant(
    "FRM-5",
    check="check_incomplete_packet_is_given_up",
    code="hangs",
    both=True,
    at=wire.NEXT_OF_READER,
)
def times_no_packet_behind_another(original, self, now):
    """Waits for ever for the rest of a packet that began behind a whole one."""
    payload = original(self, now)
    if payload is not None:
        self.deadline = now + NEVER
    return payload


@mutant("FRM-5", check="check_incomplete_packet_is_given_up", code="hangs", both=True)
def waits_for_the_rest_of_a_packet(patch):
    """Waits for ever for the rest of a packet."""
    Seam(packet_reader, "COMPLETION_SECONDS").replace(patch, NEVER)
