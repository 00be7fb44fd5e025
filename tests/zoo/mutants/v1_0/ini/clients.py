"""Mutants that break INI: what is done with an init packet."""

from splatbus_client.events import Declined, Ignored, MustClose
from splatbus_client.host_memory import CannotOpenError
from splatbus_wire import init_packet
from splatbus_wire.errors import ProtocolError

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import Json, crash, init_packets
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.chn.clients import speaks_1_0

ACCEPTS = "check_accepts_good_init_packets"
REFUSES = "check_refuses_broken_init_packets"


def _declines(patch, unwanted):
    """Decline init packets that something does not suit."""

    def images(original, packet):
        if unwanted(packet):
            raise CannotOpenError("it does not suit")
        return original(packet)

    client.OPENS_MEMORY.wrap(patch, images)


@mutant("INI-8", check=ACCEPTS, code="not-opened")
def insists_on_a_tight_ring(patch):
    """Declines a ring whose slots do not follow one another without a gap."""
    _declines(
        patch, lambda it: it.ring != init_packet.host_ring(it.width, it.height, it.ring.slots)[0]
    )


@mutant("INI-8", check=ACCEPTS, code="not-opened")
def has_room_for_sixteen_slots(patch):
    """Declines a ring of more than 16 slots."""
    _declines(patch, lambda it: it.ring.slots > 16)


@mutant("INI-8", check=ACCEPTS, code="not-opened")
def limits_the_size_to_16384(patch):
    """Takes images of more than 16,384 pixels a side for nonsense."""
    _declines(patch, lambda it: max(it.width, it.height) > 16384)


@mutant("INI-8", check=ACCEPTS, code="not-opened")
def generations_of_32_bits(patch):
    """Has 32 bits for the generation."""
    _declines(patch, lambda it: it.generation >= 1 << 32)


@mutant("INI-9", check=REFUSES, code="accepts")
def takes_any_format(patch):
    """Reads every image as RGBA32F, whatever the packet says."""
    init_packets(patch, lambda it: it["meta"].update(fmtColor="RGBA32F"))


@mutant("INI-9", check=REFUSES, code="accepts")
def ignores_the_pitches(patch):
    """Reads rows of 16·w and 4·w bytes, whatever the packet says."""
    init_packets(
        patch,
        lambda it: it["meta"].update(
            pitchColor=16 * it["meta"]["w"], pitchDepth=4 * it["meta"]["w"]
        ),
    )


@mutant("INI-9", check=REFUSES, code="accepts")
def bears_padded_rows(patch):
    """Takes a pitch with room for more than a row, where the slots have room for it."""

    def tighten(it):
        for channel, pixel in (("color", 16), ("depth", 4)):
            pitch, row = f"pitch{channel.title()}", pixel * it["meta"]["w"]
            stride = it["ring"][f"{channel}Stride"]
            if row < it["meta"][pitch] and it["meta"][pitch] * it["meta"]["h"] <= stride:
                it["meta"][pitch] = row

    init_packets(patch, tighten)


@mutant("INI-9", check=REFUSES, code="accepts")
def reads_sizes_from_strings(patch):
    """Takes a size that is written as a string."""
    init_packets(patch, lambda it: it["meta"].update(w=int(it["meta"]["w"])))


@mutant("INI-9", check=REFUSES, code="accepts")
def has_no_limit_on_the_size(patch):
    """Takes images of any size."""
    Seam(init_packet, "MAX_IMAGE_SIZE").replace(patch, 1 << 40)


@mutant("INI-9", check=REFUSES, code="accepts")
def takes_any_offset(patch):
    """Does not look at the offsets of 1.0 where it does not need them."""

    def forget(packet):
        packet["meta"].pop("offsetColor", None)
        packet["meta"].pop("offsetDepth", None)

    init_packets(patch, forget)


@mutant("INI-9", check=REFUSES, code="dies", at=client.READS_ON_IPC)
def crashes_without_a_format(original, message):
    """Crashes on an init packet that lacks a member."""
    try:
        return original(message)
    except ProtocolError as problem:
        if "is missing" in str(problem):
            crash()
        raise


@mutant("INI-9", check=REFUSES, code="dies", at=client.TAKES_PAYLOAD_ON_IPC)
def crashes_on_a_first_packet_that_is_broken(original, self, payload):
    """Crashes on a broken init packet before it has opened any memory on the connection."""
    for event in original(self, payload):
        if isinstance(event, Declined) and not self.slots and "/meta" in event.reason:
            crash()
        yield event


@mutant("INI-10", check="check_computes_in_64_bits", code="accepts")
def computes_in_32_bits(patch):
    """Keeps offsets, strides and sizes in 32 bits."""

    def wrap_around(packet):
        for part in (packet["ring"], packet["memory"]):
            for name, value in part.items():
                if isinstance(value, int):
                    part[name] = value % (1 << 32)

    init_packets(patch, wrap_around)


@mutant("INI-11", check="check_ignores_what_is_no_init_packet", code="dies", at=client.READS_ON_IPC)
def crashes_on_other_objects(original, payload):
    """Takes each object without a type for an init packet, and crashes for want of `meta`."""
    try:
        return original(payload)
    except ProtocolError as problem:
        if "INI-11" in str(problem.requirement):
            crash()
        raise


@mutant(
    "INI-11",
    check="check_ignores_what_is_no_init_packet",
    code="closes",
    at=client.TAKES_PAYLOAD_ON_IPC,
)
def closes_on_other_objects(original, self, payload):
    """Closes the connection on an object that is no init packet."""
    for event in original(self, payload):
        closing = isinstance(event, Ignored) and "INI-11" in event.reason
        yield MustClose("no init packet") if closing else event


STRANGERS = "check_ignores_what_is_no_init_packet"


@mutant("INI-11", check=STRANGERS, code="accepts")
def takes_what_has_meta_for_an_init_packet(patch):
    """Takes each object with `meta` for an init packet, whatever its `type`."""
    _takes(patch, lambda kind: True)


@mutant("INI-11", check=STRANGERS, code="accepts")
def takes_a_type_that_is_no_string_for_none(patch):
    """Looks at a `type` only if it is a string."""
    _takes(patch, lambda kind: not isinstance(kind, str))


def _takes(patch, overlooked):
    def parse(original, payload, *most):
        message: Json = original(payload, *most)
        if "meta" in message and overlooked(message.get("type")):
            message.pop("type", None)
        return message

    for seam in (wire.READS_OBJECT, client.READS_WHAT_IS_BROKEN):
        seam.wrap(patch, parse)


@mutant(
    "INI-11",
    check="check_ignores_what_is_no_init_packet",
    code="closes",
)
def closes_on_other_objects_in_1_0(patch):
    """Speaks 1.0, and closes the connection on an object that is no init packet."""
    speaks_1_0(patch)
    closes_on_other_objects.specimens[0].alter(patch)


@mutant("INI-13", check="check_goes_on_without_images", code="exits")
def exits_without_images(patch):
    """Does not handle that shared memory is missing, and exits."""
    client.MAPS_MEMORY.wrap(patch, _without_handler)


def _without_handler(original, *arguments):
    try:
        return original(*arguments)
    except FileNotFoundError as missing:
        raise RuntimeError("nobody expected this") from missing


@mutant("INI-13", check="check_goes_on_without_a_device", code="dies")
def crashes_on_cuda_memory(patch):
    """Crashes on an init packet with CUDA handles."""
    _declines(patch, lambda it: crash() if it.legacy is not None else False)
