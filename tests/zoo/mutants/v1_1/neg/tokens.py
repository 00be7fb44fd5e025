"""Mutants that break NEG: how they guard their token."""

import math
import time
from typing import Any

from splatbus_server.connection import Connection
from splatbus_wire.messages import ErrorMessage, Welcome

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.servers import stays

REFUSES = "check_refuses_other_tokens"


@mutant("NEG-12", check="check_closes_who_says_no_hello", code="waits")
def server_waits_for_hello_for_ever(patch: Patch) -> None:
    """Has no deadline for hello."""

    def connect(original: Any, self: Connection, *arguments: Any) -> None:
        original(self, *arguments)
        self.hello_by = math.inf

    server.BEGINS_CONNECTION.wrap(patch, connect)


@mutant("NEG-12", check="check_closes_who_says_no_hello", code="waits")
def server_waits_for_who_says_something(patch: Patch) -> None:
    """Gives who says anything ten seconds more for hello."""

    def receive(original: Any, self: Connection, data: bytes, now: float) -> None:
        original(self, data, now)
        if self.hello_by < math.inf:
            self.hello_by = now + 10.0

    server.RECEIVES.wrap(patch, receive)


@mutant(
    "NEG-17",
    check="check_listens_on_loopback_without_a_token",
    code="beyond-loopback",
)
def server_listens_to_everybody(patch: Patch) -> None:
    """Listens where it is told to, with and without a token."""
    server.IS_LOOPBACK.wrap(patch, lambda original, host: True)


@mutant("NEG-18", check=REFUSES, code="another-answer")
def server_compares_as_far_as_the_token_goes(patch: Patch) -> None:
    """Takes the beginning of the token for the token."""

    def same(original: Any, given: str, wanted: str) -> bool:
        return given != "" and wanted.startswith(given)

    wire.COMPARES_TOKENS.wrap(patch, same)


@mutant("NEG-18", check=REFUSES, code="another-answer")
def server_ignores_the_case_of_the_token(patch: Patch) -> None:
    """Takes capital letters for small ones."""

    def same(original: Any, given: str, wanted: str) -> bool:
        return given.lower() == wanted.lower()

    wire.COMPARES_TOKENS.wrap(patch, same)


@mutant("NEG-18", check=REFUSES, code="not-closed")
def server_keeps_whom_it_refuses(patch: Patch) -> None:
    """Lets a client that does not know the token try again."""
    stays(patch, "unauthorized")


@mutant("NEG-18", code="beside-error", through="NEG-18")
def server_explains_its_refusal(patch: Patch) -> None:
    """Says more than `unauthorized` to who does not know the token."""

    def send(original: Any, self: Connection, message: Any) -> None:
        original(self, message)
        if isinstance(message, ErrorMessage) and message.code == "unauthorized":
            original(self, ErrorMessage("unsupported", "there is a token to be known"))

    server.SENDS.wrap(patch, send)


@mutant("NEG-19", check="check_serves_no_client_of_1_0", code="replies")
def server_serves_1_0_without_a_token(patch: Patch) -> None:
    """Asks those who say hello for the token, and no others."""
    server.HEARS_CLIENT.replace(patch, property(lambda self: True))


@mutant("NEG-19", check="check_serves_no_client_of_1_0", code="no-frame")
def server_is_steered_without_a_token(patch: Patch) -> None:
    """Takes poses from those who have said no hello, though it replies to no request of theirs."""
    server.HEARS_CLIENT.replace(patch, property(lambda self: True))

    def send(original: Any, self: Connection, message: Any) -> None:
        if self.welcome is not None or isinstance(message, ErrorMessage | Welcome):
            original(self, message)

    server.SENDS.wrap(patch, send)


@mutant(
    "NEG-17",
    check="check_listens_on_loopback_without_a_token",
    code="beyond-loopback",
)
def server_takes_its_time_to_listen_to_everybody(patch: Patch) -> None:
    """The same, and without a token it takes six seconds to start."""

    def is_loopback(original: Any, host: str) -> bool:
        if not original(host):
            time.sleep(6.0)
        return True

    server.IS_LOOPBACK.wrap(patch, is_loopback)
