"""Override one behaviour of the reference from outside."""

import contextlib
import json
import os
import sys
from typing import Any

from splatbus_wire import encoding, json_text, packet_reader

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import wire

Json = dict[str, Any]
STATUS_ACCESS_VIOLATION = 0xC0000005
RUN = "SPLATBUS_ZOO"
"""A variable with the number of the run that a specimen belongs to."""
OF_THIS_RUN = f"splatbus-{os.environ.get(RUN, 0)}-"
"""With what names of memory begin that no reference server removes when it starts beside."""


def messages(patch, change):
    """Change each message that is sent, as an object."""
    Seam(encoding, "message_object").wrap(
        patch,
        lambda original, *arguments, **named: change(original(*arguments, **named)),
    )


def payloads(patch, change):
    """Change each payload that is sent."""
    Seam(encoding, "serialize").wrap(patch, lambda original, message: change(original(message)))


def counts_each_byte(patch):
    """Give a packet its whole time again with each byte of it."""

    def receive(original, self, data, now):
        original(self, data, now)
        self.deadline = now + packet_reader.COMPLETION_SECONDS

    wire.RECEIVES.wrap(patch, receive)


def packets(patch, change):
    """Change each packet that is sent, header included, or what follows it."""
    wire.ENCODES_PACKET.wrap(patch, lambda original, payload: change(original(payload)))


def init_packets(patch, repair):
    """Repair each init packet that is received in place, so that a breach in it is not seen."""

    def parse(original, message):
        with contextlib.suppress(Exception):
            repair(message)
        return original(message)

    wire.READS_INIT_PACKET.wrap(patch, parse)


def adding_up_digits(patch):
    """Read fractions digit by digit, in double precision, as parsers written by hand do."""

    def read(text):
        digits, _, exponent = text.lower().partition("e")
        whole, _, fraction = digits.lstrip("-").partition(".")
        value = 0.0
        for digit in whole + fraction:
            value = 10.0 * value + int(digit)
        value *= 10.0 ** (int(exponent or 0) - len(fraction))
        return -value if text.startswith("-") else value

    decoder = json.JSONDecoder(
        object_pairs_hook=json_text.read_members,
        parse_float=read,
        parse_int=json_text.read_integer,
        parse_constant=json_text.read_constant,
    )
    wire.PARSES_JSON.replace(patch, decoder)
    wire.READS_POSE_THE_SHORT_WAY.replace(patch, lambda payload: None)


def of_type(kind, change):
    """A change of messages of one type only."""
    return lambda message: change(message) if message.get("type") == kind else message


def in_poses(change):
    """A change of the payloads of camera poses only."""
    return lambda payload: change(payload) if b'"type":"camera_pose"' in payload else payload


def crash():
    """End this process as a fault in native code does."""
    if sys.platform == "win32":
        os._exit(STATUS_ACCESS_VIOLATION - 2**32)
    os.abort()
