"""What a testee is shown in device memory, by a client that opens one image a connection."""

import shlex
import sys
from contextlib import ExitStack
from dataclasses import replace

from splatbus_conformance.checks.registry import checks_of
from splatbus_conformance.plan import Plan
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.device_listener import DeviceListener
from splatbus_conformance.trials.moves.exchanges.exchange import STRANGER
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet

from tests.conformance.images.cuda_stand_in.library import findings_of, library
from tests.zoo import mutants

PROGRAM = (sys.executable, "-m", mutants.__name__, "opens-one-image-a-connection")


def test_who_opens_one_image_a_connection_is_shown_nothing_after_it() -> None:
    """It looks at nothing there, so a broken packet that came later would show nothing."""

    def play(trial: ClientTrial) -> None:
        with ExitStack() as held:
            listening = DeviceListener(trial, held)
            assert listening.outcome_of(packet(encode(STRANGER))) == "ignores"
            unseen = listening.image()
            listening.outcome_of(packet(encode(unseen.init_packet())), later=True)
            trial.expect(unseen.opened(trial.calls()), "unseen", "it was not seen")
            trial.delivered += 1

    library()
    name = "check_refuses_broken_init_packets"
    check = next(it for it in checks_of("client") if it.name == name)
    adapter = shlex.join(PROGRAM)
    plan = Plan("client", None, "127.0.0.1", (0, 0), (64, 48), 10.0, adapter=adapter)
    plan = replace(plan, stand_in_cuda=True)
    assert findings_of(plan, {name: replace(check, play=play)}) == {name: ""}
