"""A stand: all that it takes to try one testee, set up once and used by every check."""

from typing import Any, Protocol

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.images.memory.device import Device
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.client_testbed import ClientTestbed
from splatbus_conformance.run.server_testbed import ServerTestbed
from splatbus_conformance.trials.testee.process import Say, Testee
from splatbus_conformance.trials.trial import Trial
from splatbus_conformance.wire.sockets import Peer


class Facts(Protocol):
    """What the testee showed of itself when it was first met."""

    advice: list[str]
    """What the meeting suggests to its author."""
    device: str
    """Where device memory lies: a GPU, or the stand-in; nothing if there is none."""

    @property
    def waited_for(self) -> float:
        """For how many seconds it has to be waited for, now and then."""

    def lacks(self, need: str) -> str | None:
        """Why a check that needs this can show nothing, or None if it can."""

    def version(self) -> str:
        """The version of the specification that it is judged by: the newest that it speaks."""


class Testbed(Protocol):
    """What the checks of either side have in common."""

    @property
    def peer(self) -> Peer:
        """Its end of the wire."""

    @property
    def testee(self) -> Testee:
        """The program under test."""

    @property
    def device(self) -> Device | None:
        """Where device memory lies, if there is any."""

    @property
    def facts(self) -> Facts:
        """What is known of it."""

    def introduce(self) -> None:
        """Meet the testee for the first time. Raises NoVerdict."""

    def meet_again(self, facts: Any) -> None:
        """Meet another instance of a testee that was met, as it was then. Raises NoVerdict."""

    def trial(self, requirement: Requirement) -> Trial:
        """A trial by this requirement, with fresh connections."""

    def lost(self, *, briefly: bool) -> str:
        """Which vital sign the testee has lost since it was met, in words; nothing if none.

        Looked for briefly where nobody is charged with the loss.
        """

    def close(self) -> None:
        """End the testee, and give everything back."""


def set_up(plan: Plan, say: Say = lambda text: None) -> Testbed:
    """A testbed for this plan, which says what its user has to do.

    Raises Usage if a port cannot be had, NoVerdict if there is no shared memory.
    """
    return ClientTestbed(plan, say) if plan.side == "client" else ServerTestbed(plan, say)
