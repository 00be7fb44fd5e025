"""What was said on one connection, whichever part the harness plays there."""

from dataclasses import dataclass, field

from splatbus_conformance.wire.json_values import texts, within
from splatbus_conformance.wire.messages import Json


@dataclass
class Dealings:
    """The negotiation, and what the testee has said."""

    hello: Json | None = None
    welcome: Json | None = None
    heard: list[Json] = field(default_factory=list)
    """Every object that the testee sent."""

    @property
    def granted(self) -> list[str]:
        """The capabilities of `welcome`: those that both sides have."""
        return texts(within(self.welcome, "capabilities"))

    def all_of(self, *kinds: str) -> list[Json]:
        """What was heard of these types, in order."""
        return [message for message in self.heard if message.get("type") in kinds]

    def count(self, kind: str) -> int:
        """How many messages of this type were heard."""
        return len(self.all_of(kind))
