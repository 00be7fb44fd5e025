"""Mutants that break NEG: how they guard their token."""

import math
import time

from splatbus_wire.messages import ErrorMessage, Welcome

from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.servers import stays

REFUSES = "check_refuses_other_tokens"


@mutant("NEG-12", check="check_closes_who_says_no_hello", code="waits", at=server.BEGINS_CONNECTION)
def server_waits_for_hello_for_ever(original, self, *arguments):
    """Has no deadline for hello."""
    original(self, *arguments)
    self.hello_by = math.inf


@mutant("NEG-12", check="check_closes_who_says_no_hello", code="waits", at=server.RECEIVES)
def server_waits_for_who_says_something(original, self, data, now):
    """Gives who says anything ten seconds more for hello."""
    original(self, data, now)
    if self.hello_by < math.inf:
        self.hello_by = now + 10.0


@mutant(
    "NEG-17",
    check="check_listens_on_loopback_without_a_token",
    code="beyond-loopback",
)
def server_listens_to_everybody(patch):
    """Listens where it is told to, with and without a token."""
    server.IS_LOOPBACK.wrap(patch, lambda original, host: True)


@mutant("NEG-18", check=REFUSES, code="another-answer", at=wire.COMPARES_TOKENS)
def server_compares_as_far_as_the_token_goes(original, given, wanted):
    """Takes the beginning of the token for the token."""
    return given != "" and wanted.startswith(given)


@mutant("NEG-18", check=REFUSES, code="another-answer", at=wire.COMPARES_TOKENS)
def server_ignores_the_case_of_the_token(original, given, wanted):
    """Takes capital letters for small ones."""
    return given.lower() == wanted.lower()


@mutant("NEG-18", check=REFUSES, code="not-closed")
def server_keeps_whom_it_refuses(patch):
    """Lets a client that does not know the token try again."""
    stays(patch, "unauthorized")


@mutant("NEG-18", code="beside-error", through="NEG-18", at=server.SENDS)
def server_explains_its_refusal(original, self, message):
    """Says more than `unauthorized` to who does not know the token."""
    original(self, message)
    if isinstance(message, ErrorMessage) and message.code == "unauthorized":
        original(self, ErrorMessage("unsupported", "there is a token to be known"))


@mutant("NEG-19", check="check_serves_no_client_of_1_0", code="replies")
def server_serves_1_0_without_a_token(patch):
    """Asks those who say hello for the token, and no others."""
    server.HEARS_CLIENT.replace(patch, property(lambda self: True))


@mutant("NEG-19", check="check_serves_no_client_of_1_0", code="no-frame")
def server_is_steered_without_a_token(patch):
    """Takes poses from those who have said no hello, though it replies to no request of theirs."""
    server.HEARS_CLIENT.replace(patch, property(lambda self: True))

    def send(original, self, message):
        if self.welcome is not None or isinstance(message, ErrorMessage | Welcome):
            original(self, message)

    server.SENDS.wrap(patch, send)


@mutant(
    "NEG-17",
    check="check_listens_on_loopback_without_a_token",
    code="beyond-loopback",
    at=server.IS_LOOPBACK,
)
def server_takes_its_time_to_listen_to_everybody(original, host):
    """The same, and without a token it takes six seconds to start."""
    if not original(host):
        time.sleep(6.0)
    return True
