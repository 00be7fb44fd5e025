"""A testbed for servers: the server, and a dialler."""

from splatbus_schemas.requirements import Requirement

from splatbus_conformance.images.memory.device import STAND_IN
from splatbus_conformance.plan import Plan
from splatbus_conformance.run.vital_signs import BRIEF_SECONDS, lost_by_server
from splatbus_conformance.trials.scripted_client import ScriptedClient
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.testee import os_evidence
from splatbus_conformance.trials.testee.device_probe import (
    device_for,
    stand_in_for,
    why_server_unseen,
)
from splatbus_conformance.trials.testee.process import Awaited, Launched, Say, not_met
from splatbus_conformance.trials.testee.server_probe import (
    FRAME_SECONDS,
    ServerFacts,
    introduce,
    reach,
)
from splatbus_conformance.trials.trial import EFFECT_SECONDS, Stand
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.secrets import own_token
from splatbus_conformance.wire.sockets import CHANNELS, Peer

RESTART_SECONDS = 60.0
"""Until a server that was met, and is started anew, must listen: the machine may be busy by now."""


class ServerTestbed:
    """The harness connects to where the server listens."""

    def __init__(self, plan: Plan, say: Say) -> None:
        self.plan = plan
        self.stand_in = stand_in_for(plan)
        self.device = device_for(plan, self.stand_in)
        ports = [port or free_port(plan.host) for port in plan.ports]
        self.peer = Peer(plan.host, dict(zip(CHANNELS, ports, strict=True)), plays="client")
        device = self.stand_in.environment() if self.stand_in else {}
        self.testee = (
            Launched(plan.launch, self.peer.environment() | device)
            if plan.launch
            else Awaited(f"the server at {plan.host}", say)
        )
        self.peer.delays = lambda: os_evidence.delays(self.testee.group)
        self.facts = ServerFacts()
        self._token = own_token() or None
        self._viewer = ScriptedClient(self._token, self.device)

    def introduce(self) -> None:
        """Meet the server for the first time. Raises NoVerdict."""
        self.facts = introduce(self.peer, self._new_viewer(), self.testee, self.plan.patience)
        if not (self.facts.guarded or self.facts.unauthorized):
            self._token = None  # what nobody asks for is not said
        if self.device:
            self.facts.device = STAND_IN if self.stand_in else self.device.uuid
        if self.stand_in:
            self.facts.device_unseen = why_server_unseen(self.facts.init_packet, self.stand_in)

    @property
    def _patience(self) -> float:
        """Of who has met the server."""
        return max(self.plan.patience, RESTART_SECONDS * self.testee.expendable)

    def trial(self, requirement: Requirement) -> ServerTrial:
        """A trial with fresh connections and a fresh viewer, of a server that has drawn."""
        if self.testee.ended() is None and self.testee.ensure_running():
            self._look(FRAME_SECONDS)
        stand = Stand(self.peer, self.testee, self._patience, self.stand_in, self.device)
        return ServerTrial(requirement, stand, self._new_viewer(), self.facts)

    def meet_again(self, facts: ServerFacts) -> None:
        """Meet another instance of a server that was met, as it was then. Raises NoVerdict."""
        self.facts = facts
        self.testee.ensure_running()
        where, patience = "the ports that it was given", self._patience
        if not any(reach(self.peer, self.testee, it, patience) for it in CHANNELS):
            raise not_met(self.testee, "server", where, self.plan.host, patience)
        self._look(FRAME_SECONDS)
        self.peer.close_all()

    def lost(self, *, briefly: bool) -> str:
        """Which vital sign the server has lost since it was met, in words; nothing if none."""
        if briefly and self.testee.expendable:
            return self._look(BRIEF_SECONDS, BRIEF_SECONDS)
        return self._look(EFFECT_SECONDS)

    def _look(self, seconds: float, patience: float = 0.0) -> str:
        """Which vital sign does not come within so many seconds. A server that was just started
        has no images at first, and may say so (REQ-4): checks reckon with one that has.
        """
        viewer, patience = self._new_viewer(), patience or self._patience
        return lost_by_server(self.peer, viewer, self.testee, self.facts, patience, seconds)

    def close(self) -> None:
        """End the server and every connection to it."""
        self._viewer.close()
        self.testee.close()
        self.peer.close()
        if self.device:
            self.device.close()
        if self.stand_in:
            self.stand_in.close()

    def _new_viewer(self) -> ScriptedClient:
        self._viewer.close()
        self._viewer = ScriptedClient(self._token, self.device)
        return self._viewer
