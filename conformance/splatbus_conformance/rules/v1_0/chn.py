"""Rules on who sends what on which channel (spec 1.0 chapter 3, spec 1.1 section 2.2)."""

from collections.abc import Iterator

from splatbus_conformance.rules import Breach, Sighting, about, rule
from splatbus_conformance.rules.v1_1.mem import capabilities, kind_of_memory
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import show


@rule("CHN-6")
def silent_client(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-6: a client that never says `hello` sends nothing on the IPC channel."""
    if conversation.channel != "ipc" or conversation.hello is not None:
        return
    for message in conversation.sent_by("client"):
        if message.value is None:
            continue
        text = f"a message of type {show(message.type)} on the IPC channel, without hello"
        yield about(message, "CHN-6", Breach("sent-without-hello", text))
    stream = conversation.streams["c2s"]
    if not stream.offset and not stream.rest:
        yield Sighting("CHN-6", "client", conversation.opened)


@rule("CHN-4", "CHN-8")
def one_init_packet(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-4, CHN-8: before any `hello`, an init packet comes first, and nothing after it.

    That the images are in CUDA memory shows in the init packet itself.
    """
    if conversation.channel != "ipc":
        return
    stray: Message | None = None
    begun = False
    for message, hello, _ in conversation.placed():
        if hello is not None:
            return
        if message.sender == "client" or message.value is None or message.kind == "error":
            continue
        if begun:
            text = "a second packet on a connection that speaks 1.0"
            yield about(message, "CHN-8", Breach("further-packet", text))
        elif message.kind != "init_packet":
            stray = stray or message
        else:
            begun = True
            yield about(message, "CHN-8")
            if kind_of_memory(message) != "host_shm":
                text = "a packet that is no init packet came first"
                wrong = Breach("another-packet-first", text) if stray else None
                yield about(stray or message, "CHN-4", wrong)


@rule("CHN-5", "NEG-11")
def host_memory_only_for_those_who_ask(conversation: Conversation) -> Iterator[Sighting]:
    """CHN-5, NEG-11: memory of the host is announced only to a `hello` that lists it."""
    for message, hello, _ in conversation.placed("init_packet"):
        if kind_of_memory(message) != "host_shm":
            continue
        if hello is not None:
            listed = capabilities(hello)
            if listed is not None:
                text = "host_shm is announced, which hello does not list"
                wrong = None if "host_shm" in listed else Breach("not-listed", text)
                yield about(message, "NEG-11", wrong, "/memory/kind")
        elif conversation.hello is not None:
            wrong = Breach("before-hello", "host_shm is announced before hello")
            yield about(message, "NEG-11", wrong, "/memory/kind")
        else:
            text = "host_shm is announced on a connection that speaks 1.0"
            wrong = Breach("host-memory-announced", text)
            yield about(message, "CHN-5", wrong, "/memory/kind")
