"""Mutants of servers that cannot bear a later version, or speak as if they were one (EVO)."""

from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import encode_packet
from splatbus_wire.messages import Welcome

from tests.zoo.faults.seams import server
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.evo import LATER


@mutant("EVO-1", check=LATER, code="no-welcome", at=server.ANSWERS_HELLO)
def server_refuses_who_speaks_a_later_version(original, hello, **terms):
    """Takes a hello that lists a version which it does not know for an invalid message."""
    if set(hello.versions) - {"1.0", "1.1"}:
        raise ProtocolError("invalid_message", "there is no such version", requirement="")
    return original(hello, **terms)


@mutant("EVO-2", code="unknown-type")
def server_has_types_of_its_own(patch):
    """Sends a type of its own behind each `welcome`."""
    _server_says_behind_welcome(patch, b'{"type":"notice","text":"hi"}')


@mutant("EVO-3", code="not-granted")
def server_has_types_of_its_own_with_a_name(patch):
    """Sends a type of its vendor's that was not agreed upon."""
    _server_says_behind_welcome(patch, b'{"type":"x-example-notice","text":"hi"}')


def _server_says_behind_welcome(patch, payload):
    def send(original, self, message):
        original(self, message)
        if isinstance(message, Welcome):
            self.unsent += encode_packet(payload)

    server.SENDS.wrap(patch, send)
