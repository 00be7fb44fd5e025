"""Rules on JSON text (spec 1.0 section 2.2)."""

from collections.abc import Iterator

from splatbus_conformance.rules import Breach, Judgement, Rule, Sighting, judged, rule
from splatbus_conformance.wire.conversation import Conversation

TEXT = {
    "JSN-1": "not-a-json-object",
    "JSN-2": "byte-order-mark",
    "JSN-3": "member-twice",
    "JSN-4": "not-finite",
    "JSN-5": "too-deep",
}
"""The requirements on the text, and the code of a breach of each."""


@rule(*TEXT)
def one_strict_object(conversation: Conversation) -> Iterator[Sighting]:
    """JSN-1 to JSN-5: each payload is one JSON object, as strict as the text asks."""
    kept = tuple(Judgement(name) for name in TEXT)
    for message in conversation.messages:
        found = [
            Judgement(name, Breach(TEXT[name], text), pointer)
            for name, text, pointer in message.faults
        ]
        yield from judged(
            conversation, message, [*found, *kept] if message.value is not None else found
        )


RULES: tuple[Rule, ...] = (one_strict_object,)
