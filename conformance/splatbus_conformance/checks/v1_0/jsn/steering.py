"""Checks on what a client says once a server of 1.0 has offered it images (spec 1.0 chapter 6)."""

from contextlib import nullcontext

from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.shown_image import image_of
from splatbus_conformance.wire.message_kinds import POSES


@check(
    "JSN-4",
    observable="the numbers of poses that come once there is an init packet",
    on={CLIENT: ("ipc", "msg")},
)
def check_writes_numbers_once_it_has_images(trial: ClientTrial) -> None:
    """The harness plays a server of 1.0 whose init packet is good, and listens for poses: some
    clients send none before they have images.
    """
    trial.role.speaks = "1.0"
    size = trial.role.width, trial.role.height
    with image_of(trial, *size) if trial.device else nullcontext() as image:
        if image is not None:
            trial.role.device_packet = image.init_packet()
        trial.connection("ipc")
        dealings = trial.role.with_(trial.connection("msg"))
        if not trial.wait(lambda: any(map(dealings.count, POSES))):
            trial.not_observable(
                "the testee sent no pose that can be read after an init packet of 1.0"
            )
        heard = (m for it in trial.peer.conversations() for m in it.sent_by("client"))
        faults = [it for m in heard if m.kind in POSES for it in m.faults]
        wrong = next((it for it in faults if it.requirement == trial.requirement.id), None)
        if wrong:
            trial.violated(wrong.code, f"in a pose after an init packet: {wrong.text}")
        trial.delivered += 1
