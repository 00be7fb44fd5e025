"""A check on when a client reads an image in device memory (spec 1.0 chapter 3)."""

from splatbus_conformance.checks import CLIENT_CALLS, CLIENT_DEVICE, Place, check
from splatbus_conformance.images.memory.cuda_stand_in import usage
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.shown_image import (
    BY_CALLS,
    BY_DIGEST,
    expect_read,
    image_of,
    is_shown,
    show,
)
from splatbus_conformance.trials.trial import REACTION_SECONDS

UNDER_WAY_SECONDS, PENDING_SECONDS = 0.1, 0.3
"""Until copies that waited for an earlier record are done; for which nothing may be read."""


@check("BUF-11", on={CLIENT_DEVICE: BY_DIGEST, CLIENT_CALLS: BY_CALLS})
def check_reads_no_image_before_its_event(trial: ClientTrial, place: Place) -> None:
    """The event is pending for a third of a second, again and again, and meanwhile the memory holds
    what is no image: it is not copied at first, and not shown later. Before each copy of the same
    bytes the stream, or the host, must wait.
    """
    by_calls, before = place == "calls", None
    with image_of(trial) as image:
        for number in range(2, 6):
            image.event.begin()
            if before:
                trial.rest(UNDER_WAY_SECONDS)
            for plane in image.planes.values():
                plane.memory.poison()
            if before is None:
                show(trial, image.init_packet())
                trial.uses(lambda: not by_calls or image.opened(trial.calls()))
            trial.rest(PENDING_SECONDS)
            if before is None:
                for call in image.copies(trial.calls()) if by_calls else ():
                    what = f"while the event was pending it called {call}"
                    trial.violated("read-before-event", what)
            elif not by_calls:
                what = "it shows what the memory held while the event was pending"
                trial.expect(is_shown(trial, before), "read-before-event", what)
            image.draw(number)
            image.event.complete()
            expect_read(trial, image, place)
            before = image.painting().digests()
        trial.rest(REACTION_SECONDS)
        for call in usage.unwaited(trial.calls()) if by_calls else ():
            if call.memory in image.names:
                what = f"its stream did not wait for the event before {call}"
                trial.violated("not-waited", what)
