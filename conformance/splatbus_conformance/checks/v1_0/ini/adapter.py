"""Checks on where a client finds its images (spec 1.1 chapter 3): rings and memory of all kinds."""

from contextlib import ExitStack
from typing import Any

from hypothesis import strategies as st

from splatbus_conformance.cases.malformed.init_packets import ROOM, changed
from splatbus_conformance.cases.rings import GAP, MOST_GAPS, ORDERS, Arrangement
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.images.painted import coordinates
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import READS, FrameLender

Size = tuple[int, int, int]
"""Width and height in pixels, and how many slots."""
Ring = tuple[Size, Arrangement]

ODD: tuple[Ring, ...] = (
    ((31, 17, 3), Arrangement(ORDERS[0], GAP, GAP, GAP)),
    ((2, 3, 2), Arrangement(ORDERS[1], 0, 2 * GAP, GAP)),
    ((1, 5, 4), Arrangement(ORDERS[2], 3 * GAP, GAP, 0)),
    ((64, 1, 2), Arrangement(ORDERS[1], 5 * GAP)),
)
"""Rows of depth that end between two multiples of 16, in every order, with gaps everywhere."""
OFFSETS: dict[str, Any] = {"meta/offsetColor": 16 * GAP, "meta/offsetDepth": 4}
"""Members that have no meaning in a ring."""
GAPS = st.integers(0, MOST_GAPS).map(lambda gaps: GAP * gaps)
RINGS = st.tuples(
    st.tuples(st.integers(1, 48), st.integers(1, 48), st.integers(1, 6)),
    st.builds(Arrangement, st.sampled_from(ORDERS), GAPS, GAPS, GAPS),
)


@check("INI-8", observable="digests of what the client shows", on={CLIENT: (*READS, "returns:ipc")})
def check_shows_what_any_ring_holds(trial: ClientTrial) -> None:
    """Rings of every order and spacing, of odd sizes, one after the other; the packets have the
    offsets of 1.0 too, which have no meaning there. In each, every slot is lent once.
    """
    role = trial.role
    role.offers_memory = role.lends_frames = False
    with ExitStack() as held:
        role.memory = held.enter_context(HostMemory(ROOM))
        for size, arrangement in trial.each(ODD, RINGS, quick=4, full=60):
            connection = trial.for_init_packet()
            role.width, role.height, role.slots = size
            role.arrange(Arrangement(*arrangement))
            offered = changed(role.init_packet(connection), OFFSETS)
            role.offer(connection, offered)
            ring = f"the ring {offered['ring']} of images of {size[0]}x{size[1]}"
            trial.expect(trial.opens(connection), "not-opened", f"{ring} was not opened")
            lender = FrameLender(trial, connection)
            for number in range(role.slots):
                lender.show(coordinates(number, *lender.size))
                _judge(trial, lender, f"of {ring}")


@check(
    "CHN-24", observable="digests of what the client shows", on={CLIENT: (*READS, "returns:ipc")}
)
def check_shows_the_memory_of_the_new_connection(trial: ClientTrial) -> None:
    """The connection is lost and comes back, and each time there is other memory, whose size and
    images are as before.
    """
    with ExitStack() as held:
        for number in range(4):
            trial.role.memory = held.enter_context(HostMemory(trial.role.memory.size))
            lender = FrameLender(trial)
            lender.show(coordinates(number, *lender.size))
            _judge(trial, lender, "was read in memory that a reconnect has put in place")
        trial.peer.close_all()


def _judge(trial: ClientTrial, lender: FrameLender, where: str) -> None:
    answer = trial.ask("digest")
    if answer["seq"] not in lender.shown:
        trial.not_observable("the client shows no image that was lent")
    if wrong := lender.misread(answer):
        trial.violated("other-pixels", f"image {answer['seq']} {where}: {wrong}")
    trial.delivered += 1
