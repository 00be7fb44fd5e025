"""Mutants of clients that misread init packets of 1.0, whose memory nobody but a device has."""

import os
from base64 import b64decode, b64encode

from splatbus_client.host_memory import CannotOpenError
from splatbus_wire.errors import ProtocolError

from tests.zoo.faults.seams import client, cuda, wire
from tests.zoo.faults.surgery import crash, init_packets
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.frm import both
from tests.zoo.mutants.v1_0.frm import clients as framing
from tests.zoo.mutants.v1_0.ini import clients as packets
from tests.zoo.mutants.v1_0.jsn import reading

BROKEN = "check_refuses_broken_init_packets"
GOES_ON = "check_goes_on_without_images"


@mutant("INI-9", check=BROKEN, code="accepts")
def opens_whatever_the_pitches(patch):
    """Does not look at the pitches."""
    packets.ignores_the_pitches(patch)


@mutant("INI-9", check=BROKEN, code="accepts")
def takes_base64_as_it_comes(patch):
    """Decodes handles as leniently as its language does."""

    def reencode(message):
        for name in ("mem_color", "mem_depth", "evt_done"):
            message[name] = b64encode(b64decode(message[name])).decode()

    init_packets(patch, reencode)


@mutant("INI-9", check=BROKEN, code="dies", at=client.TAKES_BROKEN_PACKET)
def dies_of_a_first_packet_that_is_broken(original, self, payload, problem):
    """Dies of a broken init packet that is the first on its connection."""
    if self.version is None and b"meta" in payload:
        crash()
    return original(self, payload, problem)


@mutant("JSN-8", check="check_does_not_act_on_broken_text", code="accepts")
def opens_what_comes_twice(patch):
    """Takes the last of two members of a name."""
    reading.reads_the_last_of_two(patch)


@mutant("JSN-9", check="check_handles_the_next_packet", code="hangs")
def opens_nothing_after_broken_text(patch):
    """Handles nothing more on a connection after a text that is no JSON."""
    reading.deaf_after_broken_text(patch)


@mutant("INI-11", check="check_ignores_what_is_no_init_packet", code="accepts")
def opens_what_has_a_type(patch):
    """Takes each object with `meta` for an init packet, whatever its `type`."""
    packets.takes_what_has_meta_for_an_init_packet(patch)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken")
def opens_one_packet_a_read(patch):
    """Handles the first packet that a read completes, and drops what came with it."""
    both.drops_what_follows_a_packet.specimens[0].alter(patch)


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_packet_continues_for_a_device(patch):
    """Goes on with half a packet on the next connection."""
    framing.half_a_packet_continues(patch)


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def opens_by_integers_without_a_fraction_only(patch):
    """Takes 64.0 for no integer."""
    reading.takes_integers_without_a_fraction_only.specimens[0].alter(patch)


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores", at=wire.READS_INIT_PACKET)
def opens_by_known_members_only(original, message):
    """Takes an init packet of 1.0 with a member that it does not know for broken."""
    if len(message) != 4:
        raise ProtocolError("invalid_message", "unknown member", requirement="JSN-7")
    return original(message)


def _unhandled(patch, end):
    """End in this way where memory or an event cannot be opened."""

    def images(original, self, packet):
        try:
            original(self, packet)
        except CannotOpenError:
            end()

    cuda.BEGINS_WITH_BUFFERS.wrap(patch, images)


@mutant("INI-13", check=GOES_ON, code="exits")
def exits_on_an_unknown_handle(patch):
    """Exits where it cannot open what a packet names."""
    _unhandled(patch, lambda: os._exit(7))


@mutant("INI-13", check=GOES_ON, code="dies")
def dies_on_an_unknown_handle(patch):
    """Dies where it cannot open what a packet names."""
    _unhandled(patch, crash)
