"""Mutants that break NEG: how they answer `hello`."""

from splatbus_conformance.wire.message_kinds import CAPABILITIES
from splatbus_server.connection import Refusal
from splatbus_server.memory import Memory
from splatbus_server.reader import Reader
from splatbus_wire.errors import ProtocolError
from splatbus_wire.init_packet import CudaMemory, LegacyBuffers
from splatbus_wire.messages import (
    ErrorMessage,
    Hello,
    SubscribeTelemetry,
    ViewportSize,
    Welcome,
    encode,
)

from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import messages, of_type
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_1.neg.clients import without

Answer = Welcome | ErrorMessage
HANDLE = b"a handle that nobody can open".ljust(64, b".")


def greets(patch, around):
    """Answer each hello by a function of the usual answer, the hello and the server's terms."""

    def answer_hello(original, hello, **terms):
        return around(lambda as_if: original(as_if, **terms), hello, terms)

    server.ANSWERS_HELLO.wrap(patch, answer_hello)


def stays(patch, reason):
    """Go on where a connection should end for this reason."""

    def end(original, self, why, now):
        if reason not in why:
            original(self, why, now)

    server.ENDS_CONNECTION.wrap(patch, end)


@mutant("NEG-6", check="check_names_the_first_version_that_it_speaks", code="another-version")
def server_prefers_its_newest_version(patch):
    """Speaks 1.1 wherever hello lists it, whatever stands before it."""

    def answer(usual, hello, terms):
        newest_first = tuple(sorted(hello.versions, key=lambda version: version != "1.1"))
        given: Answer = usual(hello._replace(versions=newest_first))
        return given

    greets(patch, answer)


HAS = "check_has_what_it_grants"


@mutant("NEG-7", check=HAS, code="denied", at=server.TAKES_SUBSCRIPTION)
def server_grants_what_it_denies(original, self, connection, channels):
    """Answers each subscription to colour and depth as if that had not been agreed upon."""
    return connection.complain(Refusal("unsupported", "nobody agreed on that"))


@mutant("NEG-7", check=HAS, code="denied", at=server.HANDLES_MESSAGE)
def server_grants_what_it_does_not_know(original, self, connection, message, now):
    """Grants telemetry, and does not know what a subscription to it is."""
    if isinstance(message, SubscribeTelemetry):
        return connection.complain(Refusal("unknown_type", "what is that?"))
    return original(self, connection, message, now)


@mutant("NEG-6", check="check_names_the_first_version_that_it_speaks", code="no-welcome")
def server_wants_to_know_who_says_hello(patch):
    """Takes a hello whose client has no name for a broken one."""

    def answer(usual, hello, terms):
        if not hello.client.name:
            raise ProtocolError("invalid_message", "who is there?", requirement="NEG-2")
        given: Answer = usual(hello)
        return given

    greets(patch, answer)


@mutant("NEG-6", code="version-in-common", through="NEG-33")
def server_takes_the_versions_that_it_lacks(patch):
    """Looks for a version that it does not speak, and refuses whoever lists only those it does."""

    def answer(usual, hello, terms):
        strange = [it for it in hello.versions if it not in terms["versions"]]
        given: Answer = usual(hello._replace(versions=("1.1",) if strange else ("0.0",)))
        return given._replace(version=strange[0]) if isinstance(given, Welcome) else given

    greets(patch, answer)


@mutant("NEG-6", code="refuses-a-good-hello", through="NEG-33")
def server_knows_no_good_hello(patch):
    """Finds fault with every hello."""

    def answer(usual, hello, terms):
        fault = ProtocolError("invalid_message", "that is none", requirement="NEG-2")
        fault.received = {"type": "hello"}
        raise fault

    greets(patch, answer)


@mutant("NEG-6", code="not-listed", through="NEG-10")
def server_welcomes_who_speaks_another_version(patch):
    """Names its own version in welcome, whether or not hello lists it."""
    greets(patch, lambda usual, hello, terms: usual(hello._replace(versions=("1.1",))))


@mutant("NEG-7", check="check_grants_what_both_have", code="other-capabilities")
def server_grants_frames_with_reinit_only(patch):
    """Forgets that it has frames where hello does not list reinit."""

    def answer(usual, hello, terms):
        listed = [c for c in hello.capabilities if c != "frames" or "reinit" in hello.capabilities]
        given: Answer = usual(hello._replace(capabilities=tuple(listed)))
        return given

    greets(patch, answer)


@mutant("NEG-7", code="not-listed", through="NEG-7")
def server_lists_all_that_it_can(patch):
    """Lists in welcome what it has, whatever hello lists."""

    def answer(usual, hello, terms):
        given: Answer = usual(hello)
        if isinstance(given, Welcome):
            return given._replace(capabilities=tuple(terms["capabilities"]))
        return given

    greets(patch, answer)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="no-welcome")
def server_refuses_unknown_capabilities(patch):
    """Takes a hello with a capability that it does not know for an invalid message."""

    def answer(usual, hello, terms):
        if set(hello.capabilities) - set(CAPABILITIES["ipc"]):
            raise ProtocolError("invalid_message", "there is no such capability", requirement="")
        given: Answer = usual(hello)
        return given

    greets(patch, answer)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="other-capabilities")
def server_reads_four_capabilities(patch):
    """Has room for four capabilities, and reads none of a longer list."""

    def answer(usual, hello, terms):
        listed = hello.capabilities if len(hello.capabilities) <= 5 else ()
        given: Answer = usual(hello._replace(capabilities=listed))
        return given

    greets(patch, answer)


@mutant(
    "NEG-8", check="check_ignores_unknown_capabilities", code="hangs", at=server.HANDLES_MESSAGE
)
def server_announces_nothing_to_strangers(original, self, connection, *arguments):
    """Welcomes a client with a capability that it does not know, and announces no memory to it."""
    message = arguments[0]
    if isinstance(message, Hello) and set(message.capabilities) - set(CAPABILITIES["ipc"]):
        return None
    return original(self, connection, *arguments)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes", at=server.REFUSES_PACKET)
def server_closes_at_unknown_types(original, self, error, now):
    """Ends a connection on which it does not know the type of a message."""
    if error.code == "unknown_type":
        self.end("there is no such type", now)
    return original(self, error, now)


@mutant("NEG-10", check="check_refuses_unknown_versions", code="no-versions")
def server_keeps_its_versions_to_itself(patch):
    """Refuses versions without saying which it speaks."""
    messages(patch, of_type("error", without("supported")))


@mutant("NEG-10", check="check_refuses_unknown_versions", code="not-closed")
def server_keeps_whom_it_does_not_understand(patch):
    """Refuses versions, and waits for another hello."""
    stays(patch, "unsupported_version")


@mutant("NEG-10", code="bad-string", through="NEG-10")
def server_supports_what_is_no_version(patch):
    """Names its versions with a letter before them."""

    def named(message):
        supported = message.get("supported")
        return message | {"supported": [f"v{v}" for v in supported]} if supported else message

    messages(patch, of_type("error", named))


@mutant(
    "NEG-11",
    check="check_waits_for_who_can_open_its_memory",
    code="unwanted-init-packet",
    at=server.GREETS_CLIENT,
)
def server_announces_host_memory_after_each_hello(original, self, connection, now):
    """Sends the init packet after each hello."""
    if connection.channel == "ipc" and not connection.has("host_shm"):
        self.readers[connection] = Reader()
        return None
    return original(self, connection, now)


@mutant("NEG-30", code="missing-member")
def server_welcomes_without_a_name(patch):
    """Does not say in welcome who it is."""
    messages(patch, of_type("welcome", without("server")))


@mutant("NEG-31", code="sent-twice", through="NEG-26", at=server.GREETS)
def server_welcomes_twice(original, self, hello, now):
    """Answers a second hello like the first."""
    if self.welcome is not None:
        self.send(self.welcome)
        return Refusal("invalid_message", "hello was said before")
    return original(self, hello, now)


def announces_cuda_memory(patch, **changes):
    """Announce memory on a device that nobody has, and no other; every memory that is made."""
    made: list[Memory] = []

    def init(original, self, *arguments, **named):
        original(self, *arguments, **named)
        usual = self.init_packet
        assert usual.ring is not None
        memory = CudaMemory("GPU-" + "-".join(("0" * 8, *["0" * 4] * 3, "0" * 12)), HANDLE, 2**40)
        self.init_packet = usual._replace(
            legacy=LegacyBuffers(HANDLE, HANDLE, HANDLE),
            memory=memory,
            ring=usual.ring._replace(events=(HANDLE,) * usual.ring.slots),
        )
        made.append(self)

    server.ALLOCATES.wrap(patch, init)
    server.CAPABILITIES_ON_IPC.replace(patch, ("cuda_ipc",))
    return made


def at_once(patch, made, *, version=True):
    """Send the init packet as soon as there is a connection, and nothing about it later; nothing at
    all where a token is required (NEG-18).
    """

    def connect(original, self, channel, terms, now):
        original(self, channel, terms, now)
        if channel == "ipc" and terms.token is None:
            packet = made[-1].init_packet
            if not version:
                packet = packet._replace(version=None, generation=None, memory=None, ring=None)
                packet = packet._replace(semantics=None)
            self.send(packet)

    server.BEGINS_CONNECTION.wrap(patch, connect)
    server.HEARS_OF_MEMORY.replace(patch, lambda *_: None)


@mutant("NEG-15", check="check_sends_cuda_memory_at_once", code="no-version")
def server_announces_cuda_memory_as_in_1_0(patch):
    """Sends each connection at once what 1.0 has, although it speaks 1.1."""
    at_once(patch, announces_cuda_memory(patch), version=False)


@mutant("NEG-15", check="check_sends_cuda_memory_at_once", code="no-init-packet")
def server_announces_cuda_memory_after_hello(patch):
    """Waits for hello before it says where in CUDA memory its images are."""
    made = announces_cuda_memory(patch)

    def greet(original, self, connection, now):
        if connection.channel == "ipc":
            connection.send(made[-1].init_packet)

    server.GREETS_CLIENT.wrap(patch, greet)
    server.HEARS_OF_MEMORY.replace(patch, lambda *_: None)


@mutant("NEG-33", check="check_speaks_1_0_to_who_asked_for_it", code="other-capabilities")
def server_grants_capabilities_to_1_0(patch):
    """Lists in a `welcome` for 1.0 what it can do."""
    grant = {"capabilities": ["host_shm"]}
    messages(patch, of_type("welcome", lambda w: w | grant if w["version"] == "1.0" else w))


@mutant(
    "NEG-33", check="check_speaks_1_0_to_who_asked_for_it", code="newer-version", at=server.SENDS
)
def server_speaks_1_1_after_all(original, self, message):
    """Agrees to 1.0, and replies as in 1.1."""
    if isinstance(message, ViewportSize):
        self.unsent += encode(message, typed_replies=True)
    else:
        original(self, message)
