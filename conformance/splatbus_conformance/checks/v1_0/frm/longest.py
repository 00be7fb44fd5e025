"""Checks on how servers take packets of the greatest length (spec 1.0 section 2.1)."""

import itertools

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.checks.v1_0.frm.headers import MOST
from splatbus_conformance.checks.v1_0.frm.pieces import Cuts, send_cut
from splatbus_conformance.checks.v1_0.frm.servers import REQUEST
from splatbus_conformance.trials.controls import VIEWPORT_REQUEST
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.exchanges.answered import replies_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import camera_pose, encode, hello
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS


@check("FRM-4", on={SERVER: ()}, observable="the server answers a request of the greatest length")
def check_the_longest_packet(trial: ServerTrial) -> None:
    """A request made as long as a payload may be by white space, or by a member that nobody knows:
    whole, in two pieces, and joined with the next; before hello, and after it.
    """
    blank = encode(VIEWPORT_REQUEST).ljust(MOST)
    room = MOST - len(encode(VIEWPORT_REQUEST | {"": ""}))
    filled = encode(VIEWPORT_REQUEST | {"": "x" * room})
    places = ((blank, MOST // 2), (filled, 3), (filled, MOST + 2))
    versions = (False, True) if trial.facts.welcome["msg"] is not None else (False,)
    for greets, (payload, place) in trial.each(list(itertools.product(versions, places))):
        connection = trial.greeted("msg") if greets else trial.dial("msg")
        send_cut(trial, connection, packet(payload) + REQUEST, Cuts([place], 0.0005))
        answered = len(replies_after(trial, connection, 0, 2)) == 2
        trial.expect(
            answered and not connection.ended,
            "no-reply",
            f"a request of {MOST:,} bytes and another one, cut at {place}, were not answered",
        )
        trial.delivered += 1
        connection.close()


@check(
    "FRM-4",
    observable="the server answers a hello of the greatest length",
    on={SERVER: ("1.1",)},
    cases=Cases(CHANNELS),
)
def check_the_longest_hello(trial: ServerTrial, channel: Channel) -> None:
    """The same of `hello`, on both channels."""
    said = encode(hello(trial.viewer.capabilities[channel], trial.viewer.token))
    connection = trial.before_hello(channel)
    connection.send(packet(said.ljust(MOST)))
    trial.expect(
        trial.is_welcomed(connection),
        "no-welcome",
        f"{channel}: a hello of {MOST:,} bytes has no welcome",
    )
    trial.delivered += 1
    connection.close()


@check("FRM-4", observable="a frame shows a pose of the greatest length", on={SERVER: ("frames",)})
def check_the_longest_pose(trial: ServerTrial) -> None:
    """The same of poses, of a client of 1.0 and of one of 1.1."""
    steering = CameraControl(trial)
    poser = trial.dial("msg")
    trial.expect(steering.shows(poser, camera_pose()), "not-applied", "no frame shows a good pose")
    for x, greets in enumerate((False, True) if trial.facts.welcome["msg"] else (False,), 2):
        poser.close()
        poser = trial.greeted("msg") if greets else trial.dial("msg")
        pose = camera_pose((float(x), 0.0, 0.0))
        taken = steering.takes(poser, pose, encode(pose).ljust(MOST))
        trial.judge(taken, f"a pose of {MOST:,} bytes")
