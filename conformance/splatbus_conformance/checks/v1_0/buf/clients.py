"""Checks on what a client shows of images in device memory (spec 1.0 chapters 3 to 5).

They see no calls, only what comes of them, so that they judge on a GPU as on the stand-in. The
harness plays a server of 1.0.
"""

from splatbus_conformance.cases.malformed.init_packets import ABSENT, changed
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.checks.v1_0.cud.clients import LAYOUTS, image_of, show
from splatbus_conformance.images.memory.cuda_stand_in.image import DeviceImage
from splatbus_conformance.images.painted import Painting
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS, REACTION_SECONDS
from splatbus_conformance.wire.messages import Json

READS = ("device", "returns:ipc", "adapter:digest")
UNDER_WAY_SECONDS, PENDING_SECONDS = 0.1, 0.3
"""Until copies that waited for an earlier record are done; for which nothing may be read."""
GLANCE_SECONDS = 0.02
NOWHERE = 99
"""Number of a device that there is not."""


def shows(trial: ClientTrial, image: Painting, seconds: float = EFFECT_SECONDS) -> bool:
    """Whether the client comes to show this image whole, in what it reads of it."""
    return trial.uses(lambda: _is(_glance(trial), image), seconds)


def _glance(trial: ClientTrial) -> Json:
    trial.rest(GLANCE_SECONDS)
    return trial.ask("digest")


def _is(answer: Json, image: Painting) -> bool:
    if answer["seq"] is None:
        return False
    pairs = zip((answer["color"], answer["depth"]), image.digests(), strict=True)
    read = [(shown, right) for shown, right in pairs if shown is not None]
    return bool(read) and all(shown == right for shown, right in read)


def expect_shown(trial: ClientTrial, image: DeviceImage) -> None:
    """The check goes on only with a client that shows an image that is good in every way."""
    if not shows(trial, image.painting()):
        trial.not_observable("the testee does not show the image in good device memory")


@check(
    "BUF-11",
    on={CLIENT: READS},
)
def check_shows_no_image_before_its_event(trial: ClientTrial) -> None:
    """The event is pending for a third of a second, and meanwhile the memory holds what is no
    image; then it holds another.
    """
    with image_of(trial) as image:
        show(trial, image.init_packet())
        expect_shown(trial, image)
        before = image.painting()
        for number in range(2, 5):
            image.event.begin()
            trial.rest(UNDER_WAY_SECONDS)
            for plane in image.planes.values():
                plane.memory.poison()
            trial.rest(PENDING_SECONDS)
            kept = _is(trial.ask("digest"), before)
            trial.expect(
                kept,
                "read-before-event",
                "it shows what the memory held while the event was pending",
            )
            image.draw(number)
            image.event.complete()
            before = image.painting()
            if not shows(trial, before):
                trial.not_observable("the testee does not show the image that was drawn next")


@check("INI-8", on={CLIENT: READS})
def check_shows_what_the_packet_names(trial: ClientTrial) -> None:
    """Offsets absent and present, planes in one allocation or two, sizes at both ends of their
    range.
    """
    with image_of(trial) as image:
        show(trial, image.init_packet())
        expect_shown(trial, image)
    for number, (what, width, height, layout) in enumerate(trial.each(LAYOUTS), 2):
        with image_of(trial, width, height, layout) as image:
            image.draw(number)
            show(trial, image.init_packet())
            shown = shows(trial, image.painting())
            outcome = "accepts" if shown else trial.fate() or "ignores"
            trial.judge(outcome, f"an init packet with {what}: showing the image whole")


@check("CHN-24", on={CLIENT: READS})
def check_shows_the_new_memory(trial: ClientTrial) -> None:
    """The server comes back with memory of another size; that of before is still there."""
    with image_of(trial) as old, image_of(trial, 31, 17) as new:
        new.draw(2)
        show(trial, old.init_packet())
        expect_shown(trial, old)
        show(trial, new.init_packet())
        outcome = "accepts" if shows(trial, new.painting()) else trial.fate() or "ignores"
        trial.judge(outcome, "memory of 31x17 after a reconnect")
        old.draw(3)
        trial.rest(REACTION_SECONDS)
        shown = _is(trial.ask("digest"), old.painting())
        trial.expect(
            not shown, "stale-memory", "it shows an image in memory of a connection that has ended"
        )


@check(
    "CUD-6",
    on={CLIENT: READS},
    may_crash=True,
)
def check_opens_nothing_on_another_device(trial: ClientTrial) -> None:
    """`meta.device` names a device that is not there, in a packet that is good otherwise; where it
    is absent, it is device 0.
    """
    assert trial.device is not None, "a check of device memory needs a device"
    with image_of(trial) as good, image_of(trial) as elsewhere:
        show(trial, good.init_packet())
        expect_shown(trial, good)
        elsewhere.draw(7)
        show(trial, changed(elsewhere.init_packet(), {"meta/device": NOWHERE}))
        shown = shows(trial, elsewhere.painting(), 5 * REACTION_SECONDS)
        trial.expect(
            not shown,
            "another-device",
            f"it shows an image that is said to lie on device {NOWHERE}",
        )
        if trial.device.ordinal == 0:
            show(trial, changed(elsewhere.init_packet(), {"meta/device": ABSENT}))
            outcome = "accepts" if shows(trial, elsewhere.painting()) else trial.fate() or "ignores"
            trial.expect(
                outcome == "accepts",
                "default-not-applied",
                "it does not take an absent meta.device for 0",
            )
