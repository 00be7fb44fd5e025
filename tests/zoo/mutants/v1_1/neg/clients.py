"""Mutants that break NEG: `hello`, `welcome`, `error`."""

from typing import Any

from splatbus_client import reading
from splatbus_client.events import Ignored, MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    ErrorMessage,
    GetViewportSize,
    OpenFailed,
    Release,
    Subscribe,
    encode,
)

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client
from tests.zoo.faults.surgery import Json, crash, messages, of_type, packets
from tests.zoo.mutant import mutant


def without(name: str) -> Any:
    """A change that leaves a member out."""
    return lambda message: {key: value for key, value in message.items() if key != name}


@mutant("NEG-1", code="before-hello", through="CHN-17")
def request_before_hello(patch: Patch) -> None:
    """Asks for the size before it says hello."""

    def init(original: Any, self: MessageProtocol, hello: Any) -> None:
        original(self, hello)
        self.unsent[:0] = encode(GetViewportSize())

    Seam(MessageProtocol, "__init__").wrap(patch, init)


@mutant("NEG-2", code="missing-member", through="CHN-17")
def hello_without_client(patch: Patch) -> None:
    """Says hello without saying who it is."""
    messages(patch, of_type("hello", without("client")))


@mutant("NEG-2", code="bad-string", through="CHN-17")
def version_as_a_number(patch: Patch) -> None:
    """Lists its versions as numbers."""
    messages(patch, of_type("hello", lambda hello: hello | {"versions": [1.1, 1.0]}))


@mutant("NEG-2", code="not-an-array", through="CHN-17")
def capabilities_of_null(patch: Patch) -> None:
    """Says that it has no capabilities by null."""
    messages(patch, of_type("hello", lambda hello: hello | {"capabilities": None}))


@mutant("NEG-2", code="not-unique", through="CHN-17")
def capability_twice(patch: Patch) -> None:
    """Declares a capability twice."""

    def twice(hello: Json) -> Json:
        return hello | {"capabilities": [*hello["capabilities"], "frames", "frames"]}

    messages(patch, of_type("hello", twice))


@mutant("NEG-3", code="sent-twice")
def hello_twice(patch: Patch) -> None:
    """Says hello again after the first welcome."""

    def on_welcome(original: Any, self: IpcProtocol, welcome: Any) -> Any:
        if self.version is None:
            self.unsent += encode(self.hello)
        return original(self, welcome)

    client.TAKES_WELCOME_ON_IPC.wrap(patch, on_welcome)


@mutant("NEG-4", check="check_can_do_what_it_declares", code="not-released")
def frames_declared_and_not_released(patch: Patch) -> None:
    """Declares `frames`, and never releases one."""
    client.RELEASES.replace(patch, lambda self, frame: None)


@mutant("NEG-4", check="check_can_do_what_it_declares", code="not-closed")
def reinit_declared_and_not_done(patch: Patch) -> None:
    """Declares `reinit`, and ignores every further init packet."""

    def on_init_packet(original: Any, self: IpcProtocol, packet: Any) -> Any:
        return [] if self.last_generation else original(self, packet)

    client.TAKES_INIT_PACKET.wrap(patch, on_init_packet)


@mutant("NEG-5", check="check_sends_only_what_was_granted", code="before-welcome")
def subscribes_before_welcome(patch: Patch) -> None:
    """Subscribes right after hello."""

    def init(original: Any, self: IpcProtocol, *arguments: Any) -> None:
        original(self, *arguments)
        self.unsent += encode(Subscribe(frozenset({"color"})))

    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("NEG-5", check="check_sends_only_what_was_granted", code="not-granted")
def subscribes_without_the_capability(patch: Patch) -> None:
    """Subscribes whether `welcome` lists `subscribe` or not."""

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        original(self, packet)
        self.unsent += encode(Subscribe(frozenset({"color"})))

    client.SAYS_OPENED.wrap(patch, opened)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def refuses_unknown_capabilities(patch: Patch) -> None:
    """Takes a `welcome` that lists a capability which it does not know for broken."""

    def decode(original: Any, payload: bytes) -> Any:
        message = original(payload)
        listed = getattr(message, "capabilities", ())
        if unknown := set(listed) - set(reading.CAPABILITIES):
            raise ProtocolError("invalid_message", f"unknown {unknown}", requirement="NEG-8")
        return message

    client.READS_ON_IPC.wrap(patch, decode)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes")
def closes_on_unknown_types(patch: Patch) -> None:
    """Closes the IPC connection on a message of a type that it does not know."""

    def on_payload(original: Any, self: IpcProtocol, payload: bytes) -> Any:
        for event in original(self, payload):
            unknown = isinstance(event, Ignored) and "not known here" in event.reason
            yield MustClose("unknown type") if unknown else event

    client.TAKES_PAYLOAD_ON_IPC.wrap(patch, on_payload)


@mutant(
    "NEG-8",
    check="check_ignores_unknown_capabilities_of_the_message_channel",
    code="closes",
)
def refuses_unknown_capabilities_of_the_message_channel(patch: Patch) -> None:
    """Closes the message connection on a `welcome` with a capability that it does not know."""

    _on_unknown_capabilities(patch, MustClose("unknown capability"))


@mutant(
    "NEG-8",
    check="check_ignores_unknown_capabilities_of_the_message_channel",
    code="not-agreed",
)
def overlooks_a_welcome_with_unknown_capabilities(patch: Patch) -> None:
    """Goes on as before on the message channel, where `welcome` has one that it does not know."""
    _on_unknown_capabilities(patch, Ignored("unknown capability"))


def _on_unknown_capabilities(patch: Patch, event: MustClose | Ignored) -> None:
    def on_welcome(original: Any, self: MessageProtocol, welcome: Any) -> Any:
        if set(welcome.capabilities) - set(self.hello.capabilities):
            return [event]
        return original(self, welcome)

    client.TAKES_WELCOME.wrap(patch, on_welcome)


@mutant(
    "NEG-9",
    check="check_ignores_unknown_types_of_the_message_channel",
    code="closes",
)
def closes_on_unknown_types_of_the_message_channel(patch: Patch) -> None:
    """Closes the message connection on a message of a type that it does not know."""

    def on_payload(original: Any, self: MessageProtocol, payload: bytes, now: float) -> Any:
        for event in original(self, payload, now):
            unknown = isinstance(event, Ignored) and "not known here" in event.reason
            yield MustClose("unknown type") if unknown else event

    client.TAKES_PAYLOAD.wrap(patch, on_payload)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def subscribes_on_the_message_channel_of_1_0(patch: Patch) -> None:
    """Subscribes on the message channel, after the reply of a 1.0 server."""

    def on_reply(original: Any, self: MessageProtocol, reply: Any, now: float) -> Any:
        self.unsent += encode(Subscribe(frozenset({"color"})))
        return original(self, reply, now)

    client.TAKES_REPLY.wrap(patch, on_reply)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="closes")
def closes_when_no_welcome_comes(patch: Patch) -> None:
    """Closes the message connection when a reply comes instead of `welcome`."""

    def on_reply(original: Any, self: MessageProtocol, reply: Any, now: float) -> Any:
        if self.version is None:
            return [MustClose("no welcome")]
        return original(self, reply, now)

    client.TAKES_REPLY.wrap(patch, on_reply)


@mutant("NEG-14", check="check_falls_back_on_the_ipc_channel", code="newer-version")
def declines_to_a_1_0_server(patch: Patch) -> None:
    """Answers `open_failed` to an init packet of a 1.0 server."""

    def open_failed(original: Any, self: IpcProtocol, packet: Any, reason: str) -> None:
        if self.version == "1.0":
            self.unsent += encode(OpenFailed(1, reason))
        original(self, packet, reason)

    client.SAYS_OPEN_FAILED.wrap(patch, open_failed)


@mutant("NEG-40", check="check_ignores_a_late_welcome", code="newer-version")
def takes_a_late_welcome_on_the_message_channel(patch: Patch) -> None:
    """Goes over to 1.1 when `welcome` comes after the reply of a server of 1.0."""
    _goes_over(patch, client.TAKES_WELCOME)


@mutant("NEG-40", check="check_ignores_a_late_welcome", code="newer-version")
def takes_a_late_welcome_on_ipc(patch: Patch) -> None:
    """Goes over to 1.1 when `welcome` comes after the init packet of a server of 1.0."""
    _goes_over(patch, client.TAKES_WELCOME_ON_IPC)


def _goes_over(patch: Patch, seam: Seam) -> None:
    def on_welcome(original: Any, self: Any, welcome: Any) -> Any:
        self.version = None
        return original(self, welcome)

    seam.wrap(patch, on_welcome)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_ipc(patch: Patch) -> None:
    """Goes on whatever version `welcome` names on the IPC channel."""
    _takes_any_version(patch, client.TAKES_WELCOME_ON_IPC)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_the_message_channel(patch: Patch) -> None:
    """Goes on whatever version `welcome` names on the message channel."""
    _takes_any_version(patch, client.TAKES_WELCOME)


def _takes_any_version(patch: Patch, seam: Seam) -> None:
    seam.wrap(
        patch,
        lambda original, self, welcome: original(self, welcome._replace(version="1.1")),
    )


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_error(patch: Patch) -> None:
    """Crashes on an `error` on the IPC channel."""

    def decode(original: Any, payload: bytes) -> Any:
        message = original(payload)
        return crash() if isinstance(message, ErrorMessage) else message

    client.READS_ON_IPC.wrap(patch, decode)


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_error_in_place_of_a_reply(patch: Patch) -> None:
    """Crashes on an `error` on the message channel."""

    def decode(original: Any, payload: bytes, request: Any) -> Any:
        message = original(payload, request)
        return crash() if isinstance(message, ErrorMessage) else message

    client.READS_MESSAGE.wrap(patch, decode)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def ids_to_a_1_0_server(patch: Patch) -> None:
    """Numbers the requests to a 1.0 server, which knows no `id`."""
    messages(patch, of_type("get_viewport_size", lambda request: {"id": 7} | request))


@mutant("NEG-14", code="no-fallback", through="NEG-14")
def subscribes_on_the_ipc_channel_of_1_0(patch: Patch) -> None:
    """Subscribes after the init packet of a 1.0 server."""

    def of_1_0(original: Any, self: IpcProtocol, packet: Any) -> Any:
        yield from original(self, packet)
        self.unsent += encode(Subscribe(frozenset({"color"})))

    Seam(IpcProtocol, "on_init_packet_of_1_0").wrap(patch, of_1_0)


@mutant("NEG-27", code="out-of-range")
def ids_as_strings(patch: Patch) -> None:
    """Writes the `id` of a request as a string."""
    messages(patch, lambda message: message | {"id": "a"} if "id" in message else message)


@mutant("NEG-5", code="not-granted", through="CHN-10")
def releases_without_the_capability(patch: Patch) -> None:
    """Declares no `frames`, and releases a frame each time it has opened memory."""
    client.CAPABILITIES_ON_IPC.replace(patch, ("host_shm", "reinit"))

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        original(self, packet)
        self.unsent += encode(Release(packet.generation, 1))

    client.SAYS_OPENED.wrap(patch, opened)


@mutant("NEG-37", code="id-in-use")
def asks_again_with_the_same_id(patch: Patch) -> None:
    """Sends each request twice, to be sure, with the same id."""
    packets(patch, lambda packet: packet * (1 + (b'"id":' in packet)))


@mutant("NEG-39", check="check_asks_for_the_size_after_hello", code="not-asked")
def asks_when_it_is_welcome(patch: Patch) -> None:
    """Says nothing behind its hello on the message channel until `welcome` has come."""

    def data_to_send(original: Any, self: MessageProtocol, now: float) -> bytes:
        if self.version is not None:
            sent: bytes = original(self, now)
            return sent
        hello = bytes(self.unsent)
        self.unsent.clear()
        return hello

    client.SENDS_MESSAGES.wrap(patch, data_to_send)
