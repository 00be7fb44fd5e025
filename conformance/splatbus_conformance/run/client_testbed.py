"""A testbed for clients: two listeners, memory to offer, and the client."""

from collections.abc import Mapping
from contextlib import ExitStack

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.cases import rings
from splatbus_conformance.images.memory.device import STAND_IN
from splatbus_conformance.images.memory.host import HostMemory, free_bytes
from splatbus_conformance.plan import NoVerdict, Plan, Usage
from splatbus_conformance.run.vital_signs import lost_by_client
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee import diagnostics, os_evidence
from splatbus_conformance.trials.testee.adapter import Adapted
from splatbus_conformance.trials.testee.adapter_smoke import smoke
from splatbus_conformance.trials.testee.client_probe import ClientFacts, introduce
from splatbus_conformance.trials.testee.device_probe import device_for, stand_in_for, why_unseen
from splatbus_conformance.trials.testee.process import Awaited, Launched, Say, Testee, not_met
from splatbus_conformance.trials.trial import Stand
from splatbus_conformance.wire.messages import init_packet_1_1
from splatbus_conformance.wire.recording import WORDS
from splatbus_conformance.wire.sockets import CHANNELS, Peer

SLOTS = (5, 3, 2, 4)
"""One of these, as the seed chooses."""


class ClientTestbed:
    """The harness listens where the client will connect to."""

    def __init__(self, plan: Plan, say: Say) -> None:
        self.plan = plan
        self.stand_in = stand_in_for(plan)
        self.device = device_for(plan, self.stand_in)
        device = self.stand_in.environment() if self.stand_in else {}
        self.facts = ClientFacts()
        with ExitStack() as undo:
            self.peer = _listening(plan)
            undo.callback(self.peer.close)
            self._memory = _memory(plan)
            undo.callback(self._memory.close)
            self.testee = self._testee(self.peer.environment() | device, say)
            self.peer.delays = lambda: os_evidence.delays(self.testee.group)
            undo.pop_all()

    def introduce(self) -> None:
        """Meet the client for the first time. Raises NoVerdict."""
        if isinstance(self.testee, Adapted):
            smoke(self.testee, self.peer, self._role())
        self.facts = introduce(self.peer, self._role, self.testee, self.plan.patience)
        if isinstance(self.testee, Adapted):
            self.facts.adapter = self.testee.greeting
        if self.device:
            self.facts.device = STAND_IN if self.stand_in else self.device.uuid
        if self.stand_in:
            if "ipc" not in self.facts.returns:
                self.testee.stop()
            self.facts.device_unseen = why_unseen(
                self.peer,
                self._role(),
                self.testee,
                self.stand_in,
                self.plan.patience,
                self.facts,
            )

    def meet_again(self, facts: ClientFacts) -> None:
        """Meet another instance of a client that was met, as it was then. Raises NoVerdict."""
        self.facts = facts
        self.testee.ensure_running()
        self.peer.until(lambda: self.peer.connections or self.testee.ended(), self.plan.patience)
        if not self.peer.connections:
            raise not_met(
                self.testee,
                "client",
                "the ports that it was given",
                self.plan.host,
                self.plan.patience,
            )

    def lost(self, *, briefly: bool) -> str:
        """Which vital sign the client has lost since it was met, in words; nothing if none."""
        return lost_by_client(self.peer, self._role(), self.testee, self.facts, self.plan.patience)

    def trial(self, requirement: Requirement) -> ClientTrial:
        """A trial with fresh connections, on both channels, and a fresh role."""
        for channel in CHANNELS:
            self.peer.listen(channel)
        stand = Stand(self.peer, self.testee, self.plan.patience, self.stand_in, self.device)
        return ClientTrial(requirement, stand, self._role(), self.facts)

    def close(self) -> None:
        """End the client, close the ports, remove the memory."""
        self.testee.close()
        self.peer.close()
        self._memory.close()
        if self.device:
            self.device.close()
        if self.stand_in:
            self.stand_in.close()

    def _testee(self, environment: Mapping[str, str], say: Say) -> Testee:
        if self.plan.adapter:
            return Adapted(self.plan.adapter, environment, self.peer, self.plan.patience)
        if self.plan.launch:
            return Launched(self.plan.launch, environment)
        return Awaited("the client that connects", say)

    def _role(self) -> ScriptedServer:
        plan = self.plan
        arrangement = rings.drawn(plan.seed)
        role = ScriptedServer(self._memory, *plan.viewport, _slots(plan), plan.seed, arrangement)
        role.gives_sizes = self.facts.takes_sizes
        return role


def _listening(plan: Plan) -> Peer:
    ports = dict(zip(CHANNELS, plan.ports, strict=True))
    peer = Peer(plan.host, ports)
    for channel in CHANNELS:
        try:
            peer.listen(channel)
        except OSError as error:
            peer.close()
            port = ports[channel]
            holder = os_evidence.listener(port)
            raise Usage(
                diagnostics.port_refused(plan.host, port, WORDS[channel], error, holder)
            ) from None
    return peer


def _slots(plan: Plan) -> int:
    return SLOTS[plan.seed % len(SLOTS)]


def _memory(plan: Plan) -> HostMemory:
    ring = init_packet_1_1("", 0, *plan.viewport, _slots(plan))
    needed: int = rings.arranged(ring, rings.drawn(plan.seed))["memory"]["bytes"]
    try:
        return HostMemory(needed)
    except OSError as error:
        told = diagnostics.no_shared_memory(error, needed, free_bytes(), plan.viewport)
        raise NoVerdict(told) from None
