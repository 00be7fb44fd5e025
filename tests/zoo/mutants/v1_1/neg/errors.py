"""Mutants that break NEG: their errors, and their replies after `hello`."""

from splatbus_conformance.wire.message_kinds import CLOSING_ERRORS
from splatbus_server import connection as connections
from splatbus_server.connection import REQUESTS, Connection, Refusal, type_and_id
from splatbus_wire.messages import ErrorMessage
from splatbus_wire.packet_reader import PacketReader

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.ctl import unsaid
from tests.zoo.mutants.v1_1.neg.clients import without


def reports_to_all(patch):
    """Send each error, whether or not there was a hello."""

    def complain(original, self, refusal):
        self.send(connections.error_message(*refusal))
        return refusal

    server.COMPLAINS.wrap(patch, complain)


@mutant("NEG-22", check="check_reports_nothing_before_hello", code="before-hello")
def server_reports_to_clients_of_1_0(patch):
    """Tells everybody what was wrong, on both channels."""
    reports_to_all(patch)


@mutant("NEG-22", check="check_reports_nothing_before_hello", code="before-hello")
def server_reports_before_hello(patch):
    """Tells everybody what was wrong."""
    reports_to_all(patch)


@mutant("NEG-23", code="wrong-value", through="NEG-26")
def server_has_codes_of_its_own(patch):
    """Makes up a code."""
    messages(patch, of_type("error", lambda error: error | {"code": "bad_" + error["code"]}))


@mutant("NEG-23", code="bad-string", through="NEG-26")
def server_points_without_a_slash(patch):
    """Writes pointers without the slash before them."""
    messages(patch, of_type("error", lambda error: error | {"pointer": "rotation"}))


def says_twice(patch, such):
    """Send each error of such a code twice."""

    def complain(original, self, refusal):
        if such(refusal.code):
            original(self, refusal)
        return original(self, refusal)

    server.COMPLAINS.wrap(patch, complain)


@mutant("NEG-23", code="bad-string", through="NEG-26")
def server_reports_at_length(patch):
    """Says more than 1,024 characters."""
    messages(patch, of_type("error", lambda error: error | {"message": "wrong! " * 200}))


@mutant("NEG-23", code="unknown-id", through="NEG-29")
def server_reports_what_it_answers_twice(patch):
    """Says twice what is wrong with a request."""

    says_twice(patch, lambda code: code not in CLOSING_ERRORS)


@mutant(
    "NEG-25", check="check_closes_after_an_error_that_ends", code="waits", at=server.ENDS_CONNECTION
)
def server_reads_on_after_a_bad_header(original, self, reason, now):
    """Reports a bad header, drops it and what was read with it, and goes on."""
    if "[FRM-3]" in reason:
        self.reader = PacketReader()
    else:
        original(self, reason, now)


@mutant("NEG-25", code="after-error", through="NEG-25")
def server_repeats_its_last_error(patch):
    """Says twice why it closes."""

    says_twice(patch, lambda code: code in CLOSING_ERRORS)


@mutant(
    "NEG-26",
    check="check_goes_on_after_an_error",
    code="no-longer-served",
    at=server.REFUSES_PACKET,
)
def server_closes_after_every_error(original, self, error, now):
    """Ends a connection after whatever it reports on it."""
    refusal = original(self, error, now)
    self.end("enough is enough", now)
    return refusal


@mutant("NEG-28", code="wrong-type", through="NEG-29")
def server_replies_as_in_1_0(patch):
    """Leaves the type out of its replies after welcome too."""
    messages(patch, of_type("viewport_size", without("type")))


@mutant("NEG-28", code="another-id", through="NEG-29")
def server_forgets_ids(patch):
    """Does not say which request a camera answers."""
    messages(patch, of_type("camera", without("id")))


@mutant(
    "NEG-29", check="check_answers_each_request_in_order", code="wrong-id", at=server.REFUSES_PACKET
)
def server_leaves_bad_requests_unanswered(original, self, error, now):
    """Says nothing to a request that breaks REQ-2."""
    if type_and_id(error.received)[0] in REQUESTS:
        return Refusal(error.code, str(error))
    return original(self, error, now)


def last_comes_first(patch):
    """Send what is said before what has been said, and not been sent yet."""

    def send(original, self, message):
        waiting = bytes(self.unsent)
        self.unsent.clear()
        original(self, message)
        self.unsent += waiting

    server.SENDS.wrap(patch, send)


@mutant("NEG-29", check="check_answers_each_request_in_order", code="another-answer")
def server_answers_the_last_first(patch):
    """Answers requests that arrive together from the last to the first."""
    last_comes_first(patch)


@mutant("NEG-29", code="out-of-order", through="NEG-29")
def server_answers_backwards(patch):
    """Answers requests that arrive together from the last to the first."""
    last_comes_first(patch)


@mutant("NEG-32", check="check_reports_what_is_no_rotation", code="ignores")
def server_keeps_quiet_about_rotations(patch):
    """Drops a pose whose quaternion is no rotation without a word."""

    unsaid(patch, "invalid_rotation")


@mutant("NEG-32", check="check_reports_what_is_no_rotation", code="ignores")
def server_calls_rotations_messages(patch):
    """Reports `invalid_message` for whatever is wrong with a pose."""
    messages(
        patch,
        of_type(
            "error",
            lambda error: error | {"code": error["code"].replace("rotation", "message")},
        ),
    )


@mutant(
    "NEG-23",
    check="check_errors_name_the_request_that_they_answer",
    code="wrong-id",
)
def server_takes_the_first_id_for_none(patch):
    """Leaves the id out of an error where it is 0."""
    messages(patch, of_type("error", lambda it: it if it.get("id") else without("id")(it)))


@mutant("NEG-34", check="check_ends_in_good_order", code="reads-on")
def server_listens_to_last_words_for_ever(patch):
    """Reads on after an error that ends, for as long as the client does not end its side."""
    Seam(connections, "LINGER_SECONDS").replace(patch, 600.0)


@mutant("NEG-34", check="check_ends_in_good_order", code="reset")
def server_closes_with_bytes_unread(patch):
    """Closes a connection as soon as the error is on its way."""
    Seam(Connection, "over").replace(
        patch, property(lambda self: not self.is_open and not self.unsent)
    )


@mutant("NEG-35", check="check_refuses_broken_hellos", code="no-reply", at=server.REFUSES_PACKET)
def server_ignores_broken_hellos(original, self, error, now):
    """Waits for a better `hello`."""
    if type_and_id(error.received)[0] == "hello" and self.welcome is None:
        return Refusal(error.code, str(error))
    return original(self, error, now)


@mutant("NEG-35", check="check_refuses_broken_hellos", code="not-closed", at=server.ENDS_CONNECTION)
def server_forgives_broken_hellos(original, self, reason, now):
    """Reports a broken `hello`, and waits for a better one."""
    if "NEG-35" not in reason:
        original(self, reason, now)


@mutant("NEG-23", check="check_errors_about_no_request_name_none", code="has-an-id")
def server_takes_poses_for_requests(patch):
    """Gives an error about a camera's pose the `id` that stands in the pose."""
    requests = {*connections.REQUESTS_1_1, "camera_pose"}
    Seam(connections, "REQUESTS_1_1").replace(patch, requests)


@mutant(
    "NEG-23",
    check="check_errors_about_no_request_name_none",
    code="has-an-id",
)
def server_names_the_last_request_in_errors(patch):
    """Puts the id of the newest request into every error."""
    newest: dict[Connection, int] = {}

    def send(original, self, message):
        if isinstance(message, ErrorMessage):
            message = message._replace(id=message.id or newest.get(self))
        elif getattr(message, "id", None) is not None:
            newest[self] = message.id
        original(self, message)

    server.SENDS.wrap(patch, send)
