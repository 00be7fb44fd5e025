"""Mutants that break NEG: what they look at first, and a `hello` that comes again."""

from splatbus_server.connection import Refusal
from splatbus_server.states import State

from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant

AGAIN = "check_answers_no_further_hello"


@mutant(
    "NEG-36",
    check="check_looks_at_the_capability_before_the_form",
    code="later-fault",
    at=server.DECODES,
)
def server_asks_for_the_capability_last(original, *payload, agreed=None, **named):
    """Complains of the form of a message before it says that nobody agreed on such."""
    original(*payload, agreed=None, **named)
    return original(*payload, agreed=agreed, **named)


@mutant("NEG-36", check="check_says_what_is_wrong_with_a_length", code="another-code")
def server_says_of_any_length_that_it_is_too_much(patch):
    """Says `packet_too_large` of every header that it does not like."""
    too_large = {"code": "packet_too_large"}
    messages(
        patch,
        of_type("error", lambda e: e | too_large if e["code"] == "malformed_packet" else e),
    )


@mutant("NEG-36", check="check_looks_at_control_last", code="later-fault", at=server.TAKES_POSE)
def server_asks_who_has_control_first(original, self, connection, message):
    """Says `busy` to whoever has no control, before it looks at the pose."""
    if self.control.holder not in (None, connection):
        return connection.complain(Refusal("busy", "another client has control"))
    return original(self, connection, message)


@mutant(
    "NEG-36", check="check_looks_at_a_hello_in_order", code="later-fault", at=server.ANSWERS_HELLO
)
def server_asks_for_the_token_last(original, hello, **settings):
    """Tells who has no token which versions it speaks."""
    if not set(hello.versions) & set(settings["versions"]):
        settings["token"] = hello.token
    return original(hello, **settings)


@mutant("NEG-38", check=AGAIN, code="another-answer", at=server.GREETS)
def server_welcomes_again(original, self, hello, now):
    """Answers a second hello as it answered the first."""
    if self.welcome is not None:
        self.send(self.welcome)
        return hello
    return original(self, hello, now)


@mutant("NEG-38", check=AGAIN, code="agreed-anew", at=server.GREETS)
def server_goes_by_a_second_hello(original, self, hello, now):
    """Complains of a second hello, and grants what that lists from then on."""
    if self.welcome is not None:
        listed = tuple(it for it in self.welcome.capabilities if it in hello.capabilities)
        self.welcome = self.welcome._replace(capabilities=listed)
    return original(self, hello, now)


@mutant(
    "NEG-33",
    check="check_speaks_1_0_to_who_asked_for_it",
    code="newer-version",
    at=server.UNDERSTANDS,
)
def server_speaks_1_1_to_who_asks_again(original, self, payload, now):
    """Agrees on 1.0, and on 1.1 by a second hello."""
    if self.state is State.AGREED_ON_1_0 and b'"hello"' in payload:
        self.state = State.NEW
    return original(self, payload, now)


@mutant("NEG-33", check="check_the_token_lets_1_0_in", code="no-reply")
def server_wants_1_1_of_who_has_the_token(patch):
    """Serves nobody who said the token and agreed on 1.0."""

    server.HEARS_CLIENT.replace(patch, property(lambda self: self.state is not State.AGREED_ON_1_0))
