"""Mutants that break NEG: what they look at first, and a `hello` that comes again."""

from typing import Any

from splatbus_server.connection import Connection, Refusal
from splatbus_server.session import Session
from splatbus_server.states import State
from splatbus_wire.messages import Hello

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant

AGAIN = "check_answers_no_further_hello"


@mutant("NEG-36", check="check_looks_at_the_capability_before_the_form", code="later-fault")
def server_asks_for_the_capability_last(patch: Patch) -> None:
    """Complains of the form of a message before it says that nobody agreed on such."""

    def decode(original: Any, *payload: Any, agreed: Any = None, **named: Any) -> Any:
        original(*payload, agreed=None, **named)
        return original(*payload, agreed=agreed, **named)

    server.DECODES.wrap(patch, decode)


@mutant("NEG-36", check="check_says_what_is_wrong_with_a_length", code="another-code")
def server_says_of_any_length_that_it_is_too_much(patch: Patch) -> None:
    """Says `packet_too_large` of every header that it does not like."""
    too_large = {"code": "packet_too_large"}
    messages(
        patch,
        of_type("error", lambda e: e | too_large if e["code"] == "malformed_packet" else e),
    )


@mutant("NEG-36", check="check_looks_at_control_last", code="later-fault")
def server_asks_who_has_control_first(patch: Patch) -> None:
    """Says `busy` to whoever has no control, before it looks at the pose."""

    def move(original: Any, self: Session, connection: Connection, message: Any) -> Any:
        if self.control.holder not in (None, connection):
            return connection.complain(Refusal("busy", "another client has control"))
        return original(self, connection, message)

    server.TAKES_POSE.wrap(patch, move)


@mutant("NEG-36", check="check_looks_at_a_hello_in_order", code="later-fault")
def server_asks_for_the_token_last(patch: Patch) -> None:
    """Tells who has no token which versions it speaks."""

    def answer(original: Any, hello: Hello, **settings: Any) -> Any:
        if not set(hello.versions) & set(settings["versions"]):
            settings["token"] = hello.token
        return original(hello, **settings)

    server.ANSWERS_HELLO.wrap(patch, answer)


@mutant("NEG-38", check=AGAIN, code="another-answer")
def server_welcomes_again(patch: Patch) -> None:
    """Answers a second hello as it answered the first."""

    def greet(original: Any, self: Connection, hello: Hello, now: float) -> Any:
        if self.welcome is not None:
            self.send(self.welcome)
            return hello
        return original(self, hello, now)

    server.GREETS.wrap(patch, greet)


@mutant("NEG-38", check=AGAIN, code="agreed-anew")
def server_goes_by_a_second_hello(patch: Patch) -> None:
    """Complains of a second hello, and grants what that lists from then on."""

    def greet(original: Any, self: Connection, hello: Hello, now: float) -> Any:
        if self.welcome is not None:
            listed = tuple(it for it in self.welcome.capabilities if it in hello.capabilities)
            self.welcome = self.welcome._replace(capabilities=listed)
        return original(self, hello, now)

    server.GREETS.wrap(patch, greet)


@mutant("NEG-33", check="check_the_token_lets_1_0_in", code="no-reply")
def server_wants_1_1_of_who_has_the_token(patch: Patch) -> None:
    """Serves nobody who said the token and agreed on 1.0."""

    server.HEARS_CLIENT.replace(patch, property(lambda self: self.state is not State.AGREED_ON_1_0))
