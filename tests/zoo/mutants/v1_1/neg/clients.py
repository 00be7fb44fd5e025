"""Mutants that break NEG: `hello`, `welcome`, `error`."""

from splatbus_client import reading
from splatbus_client.events import Ignored, MustClose
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    ErrorMessage,
    GetViewportSize,
    OpenFailed,
    Subscribe,
    encode,
)

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import crash, messages, of_type, packets
from tests.zoo.mutant import mutant


def without(name):
    """A change that leaves a member out."""
    return lambda message: {key: value for key, value in message.items() if key != name}


@mutant("NEG-1", code="before-hello", through="CHN-17", at=Seam(MessageProtocol, "__init__"))
def request_before_hello(original, self, hello):
    """Asks for the size before it says hello."""
    original(self, hello)
    self.unsent[:0] = encode(GetViewportSize())


@mutant("NEG-2", code="missing-member", through="CHN-17")
def hello_without_client(patch):
    """Says hello without saying who it is."""
    messages(patch, of_type("hello", without("client")))


@mutant("NEG-2", code="bad-string", through="CHN-17")
def version_as_a_number(patch):
    """Lists its versions as numbers."""
    messages(patch, of_type("hello", lambda hello: hello | {"versions": [1.1, 1.0]}))


@mutant("NEG-2", code="not-an-array", through="CHN-17")
def capabilities_of_null(patch):
    """Says that it has no capabilities by null."""
    messages(patch, of_type("hello", lambda hello: hello | {"capabilities": None}))


@mutant("NEG-2", code="not-unique", through="CHN-17")
def capability_twice(patch):
    """Declares a capability twice."""

    def twice(hello):
        return hello | {"capabilities": [*hello["capabilities"], "frames", "frames"]}

    messages(patch, of_type("hello", twice))


@mutant("NEG-3", code="sent-twice", at=client.TAKES_WELCOME_ON_IPC)
def hello_twice(original, self, welcome):
    """Says hello again after the first welcome."""
    if self.version is None:
        self.unsent += encode(self.hello)
    return original(self, welcome)


@mutant("NEG-4", check="check_can_do_what_it_declares", code="not-released")
def frames_declared_and_not_released(patch):
    """Declares `frames`, and never releases one."""
    client.RELEASES.replace(patch, lambda self, frame: None)


@mutant(
    "NEG-4", check="check_can_do_what_it_declares", code="not-closed", at=client.TAKES_INIT_PACKET
)
def reinit_declared_and_not_done(original, self, packet):
    """Declares `reinit`, and ignores every further init packet."""
    return [] if self.last_generation else original(self, packet)


@mutant(
    "NEG-5",
    check="check_sends_only_what_was_granted",
    code="before-welcome",
    at=client.BEGINS_ON_IPC,
)
def subscribes_before_welcome(original, self, *arguments):
    """Subscribes right after hello."""
    original(self, *arguments)
    self.unsent += encode(Subscribe(frozenset({"color"})))


@mutant(
    "NEG-5", check="check_sends_only_what_was_granted", code="not-granted", at=client.SAYS_OPENED
)
def subscribes_without_the_capability(original, self, packet):
    """Subscribes whether `welcome` lists `subscribe` or not."""
    original(self, packet)
    self.unsent += encode(Subscribe(frozenset({"color"})))


@mutant(
    "NEG-8", check="check_ignores_unknown_capabilities", code="not-opened", at=client.READS_ON_IPC
)
def refuses_unknown_capabilities(original, payload):
    """Takes a `welcome` that lists a capability which it does not know for broken."""
    message = original(payload)
    listed = getattr(message, "capabilities", ())
    if unknown := set(listed) - set(reading.CAPABILITIES):
        raise ProtocolError("invalid_message", f"unknown {unknown}", requirement="NEG-8")
    return message


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes", at=client.TAKES_PAYLOAD_ON_IPC)
def closes_on_unknown_types(original, self, payload):
    """Closes the IPC connection on a message of a type that it does not know."""
    for event in original(self, payload):
        unknown = isinstance(event, Ignored) and "not known here" in event.reason
        yield MustClose("unknown type") if unknown else event


@mutant(
    "NEG-8",
    check="check_ignores_unknown_capabilities",
    code="closes",
)
def refuses_unknown_capabilities_of_the_message_channel(patch):
    """Closes the message connection on a `welcome` with a capability that it does not know."""

    _on_unknown_capabilities(patch, MustClose("unknown capability"))


@mutant(
    "NEG-8",
    check="check_ignores_unknown_capabilities",
    code="not-agreed",
)
def overlooks_a_welcome_with_unknown_capabilities(patch):
    """Goes on as before on the message channel, where `welcome` has one that it does not know."""
    _on_unknown_capabilities(patch, Ignored("unknown capability"))


def _on_unknown_capabilities(patch, event):
    def on_welcome(original, self, welcome):
        if set(welcome.capabilities) - set(self.hello.capabilities):
            return [event]
        return original(self, welcome)

    client.TAKES_WELCOME.wrap(patch, on_welcome)


@mutant(
    "NEG-9",
    check="check_ignores_unknown_types",
    code="closes",
    at=client.TAKES_PAYLOAD,
)
def closes_on_unknown_types_of_the_message_channel(original, self, payload, now):
    """Closes the message connection on a message of a type that it does not know."""
    for event in original(self, payload, now):
        unknown = isinstance(event, Ignored) and "not known here" in event.reason
        yield MustClose("unknown type") if unknown else event


@mutant(
    "NEG-13",
    check="check_falls_back_on_the_message_channel",
    code="newer-version",
    at=client.TAKES_REPLY,
)
def subscribes_on_the_message_channel_of_1_0(original, self, reply, now):
    """Subscribes on the message channel, after the reply of a 1.0 server."""
    self.unsent += encode(Subscribe(frozenset({"color"})))
    return original(self, reply, now)


@mutant(
    "NEG-13", check="check_falls_back_on_the_message_channel", code="closes", at=client.TAKES_REPLY
)
def closes_when_no_welcome_comes(original, self, reply, now):
    """Closes the message connection when a reply comes instead of `welcome`."""
    if self.version is None:
        return [MustClose("no welcome")]
    return original(self, reply, now)


@mutant(
    "NEG-14",
    check="check_falls_back_on_the_ipc_channel",
    code="newer-version",
    at=client.SAYS_OPEN_FAILED,
)
def declines_to_a_1_0_server(original, self, packet, reason):
    """Answers `open_failed` to an init packet of a 1.0 server."""
    if self.version == "1.0":
        self.unsent += encode(OpenFailed(1, reason))
    original(self, packet, reason)


@mutant("NEG-40", check="check_ignores_a_late_welcome", code="newer-version")
def takes_a_late_welcome_on_the_message_channel(patch):
    """Goes over to 1.1 when `welcome` comes after the reply of a server of 1.0."""
    _goes_over(patch, client.TAKES_WELCOME)


@mutant("NEG-40", check="check_ignores_a_late_welcome", code="newer-version")
def takes_a_late_welcome_on_ipc(patch):
    """Goes over to 1.1 when `welcome` comes after the init packet of a server of 1.0."""
    _goes_over(patch, client.TAKES_WELCOME_ON_IPC)


def _goes_over(patch, seam):
    def on_welcome(original, self, welcome):
        self.version = None
        return original(self, welcome)

    seam.wrap(patch, on_welcome)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_ipc(patch):
    """Goes on whatever version `welcome` names on the IPC channel."""
    _takes_any_version(patch, client.TAKES_WELCOME_ON_IPC)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_the_message_channel(patch):
    """Goes on whatever version `welcome` names on the message channel."""
    _takes_any_version(patch, client.TAKES_WELCOME)


def _takes_any_version(patch, seam):
    seam.wrap(
        patch,
        lambda original, self, welcome: original(self, welcome._replace(version="1.1")),
    )


@mutant("NEG-24", check="check_survives_errors", code="dies", at=client.READS_ON_IPC)
def crashes_on_an_error(original, payload):
    """Crashes on an `error` on the IPC channel."""
    message = original(payload)
    return crash() if isinstance(message, ErrorMessage) else message


@mutant(
    "NEG-24",
    check="check_survives_errors_in_place_of_replies",
    code="dies",
    at=client.READS_MESSAGE,
)
def crashes_on_an_error_in_place_of_a_reply(original, payload, request):
    """Crashes on an `error` on the message channel."""
    message = original(payload, request)
    return crash() if isinstance(message, ErrorMessage) else message


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def ids_to_a_1_0_server(patch):
    """Numbers the requests to a 1.0 server, which knows no `id`."""
    messages(patch, of_type("get_viewport_size", lambda request: {"id": 7} | request))


@mutant("NEG-14", code="no-fallback", through="NEG-14", at=client.TAKES_INIT_PACKET_OF_1_0)
def subscribes_on_the_ipc_channel_of_1_0(original, self, packet):
    """Subscribes after the init packet of a 1.0 server."""
    yield from original(self, packet)
    self.unsent += encode(Subscribe(frozenset({"color"})))


@mutant("NEG-27", code="not-an-integer")
def ids_as_strings(patch):
    """Writes the `id` of a request as a string."""
    messages(patch, lambda message: message | {"id": "a"} if "id" in message else message)


@mutant("NEG-5", code="not-granted", through="NEG-5", at=client.TAKES_WELCOME_ON_IPC)
def takes_frames_that_were_not_agreed(original, self, welcome):
    """Takes frames whether `welcome` lists `frames` or not."""
    yield from original(self, welcome)
    self.capabilities |= {"frames"}


@mutant("NEG-37", code="id-in-use")
def asks_again_with_the_same_id(patch):
    """Sends each request twice, to be sure, with the same id."""
    packets(patch, lambda packet: packet * (1 + (b'"id":' in packet)))


@mutant(
    "NEG-39",
    check="check_asks_for_the_size_after_hello",
    code="not-asked",
    at=client.SENDS_MESSAGES,
)
def asks_when_it_is_welcome(original, self, now):
    """Says nothing behind its hello on the message channel until `welcome` has come."""
    if self.version is not None:
        sent: bytes = original(self, now)
        return sent
    hello = bytes(self.unsent)
    self.unsent.clear()
    return hello
