"""Mutants that cannot bear a later version, or speak as if they were one (EVO)."""

import json

from splatbus_client.events import MustClose
from splatbus_wire.errors import ProtocolError
from splatbus_wire.framing import encode_packet
from splatbus_wire.messages import Welcome

from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.jsn.servers import trusts_its_scene

LATER = "check_speaks_with_later_versions"


@mutant("EVO-1", check=LATER, code="not-opened", at=wire.READS_INIT_PACKET)
def declines_memory_of_later_servers(original, message):
    """Takes an init packet that names a later version for a broken one."""
    if message.get("version") not in (None, "1.1"):
        raise ProtocolError("invalid_message", "that is too new", requirement="MEM-1")
    return original(message)


@mutant("EVO-1", check=LATER, code="closes", at=client.TAKES_PAYLOAD)
def leaves_who_says_more_than_it_knows(original, self, payload, now):
    """Closes the message connection on a `welcome` with a member that it does not know."""
    message = json.loads(payload)
    if message.get("type") == "welcome" and set(message) - {"type", *Welcome._fields}:
        return [MustClose("too new")]
    return original(self, payload, now)


@mutant("EVO-2", code="unknown-capability", through="CHN-17")
def capabilities_of_its_own(patch):
    """Declares a capability of its own, by a name that a later version may use."""
    own = of_type("hello", lambda it: it | {"capabilities": [*it["capabilities"], "markers"]})
    messages(patch, own)


@mutant("EVO-2", code="unknown-type")
def types_of_its_own(patch):
    """Sends a type of its own to a server that speaks 1.1."""
    _says_once_welcome(patch, b'{"type":"marker"}')


@mutant("EVO-3", code="not-granted")
def types_of_its_own_with_a_name(patch):
    """Sends a type of its vendor's that was not agreed upon."""
    _says_once_welcome(patch, b'{"type":"x-example-marker"}')


def _says_once_welcome(patch, payload):
    def on_welcome(original, self, welcome):
        yield from original(self, welcome)
        self.unsent += encode_packet(payload)

    client.TAKES_WELCOME_ON_IPC.wrap(patch, on_welcome)


@mutant("EVO-4", code="unknown-member", both=True)
def members_of_its_own(patch):
    """Adds a member of its own, by a name that a later version may use, to all that it says."""
    trusts_its_scene(patch)
    messages(patch, lambda message: message | {"trace": 1})
