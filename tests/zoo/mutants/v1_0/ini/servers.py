"""Mutants that break INI: their init packets are not as they have to be."""

from splatbus_conformance.wire.messages import init_packet_1_0

from tests.zoo.faults.legacy import announces_at_once
from tests.zoo.faults.surgery import messages
from tests.zoo.mutant import mutant


@mutant("INI-1", code="missing-member")
def server_names_no_format_of_depth(patch):
    """Leaves the format of depth out of its init packets."""
    _meta(patch, fmtDepth=None)


@mutant("INI-2", code="not-an-integer")
def server_announces_half_a_pixel(patch):
    """Announces a width that is no integer."""
    _meta(patch, w=64.5)


@mutant("INI-3", code="wrong-value")
def server_announces_half_floats(patch):
    """Announces another format of colour."""
    _meta(patch, fmtColor="RGBA16F")


@mutant("INI-4", code="wrong-pitch")
def server_pads_its_rows(patch):
    """Announces rows of colour that are padded."""
    _meta(patch, pitchColor=2048)


@mutant("INI-5", code="out-of-range")
def server_announces_an_odd_offset(patch):
    """Announces colour at an offset that is no multiple of its pixels."""
    _meta(patch, offsetColor=8)


@mutant("INI-6", code="out-of-range")
def server_announces_no_device(patch):
    """Numbers its device -1."""
    _meta(patch, device=-1)


@mutant("INI-7", code="bad-string")
def server_sends_a_short_handle(patch):
    """Sends handles of 63 bytes at once to every client."""
    short = init_packet_1_0()
    announces_at_once(patch, short | {"mem_color": short["mem_color"][:84]})


def _meta(patch, **members):
    """Change members of `meta` in every init packet; None leaves one out."""

    def change(message):
        if "meta" not in message:
            return message
        meta = message["meta"] | members
        return message | {"meta": {k: v for k, v in meta.items() if v is not None}}

    messages(patch, change)
