"""Checks on `frame` and `release` (spec 1.1 chapter 5)."""

from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.frames import (
    BrokenFrame,
    broken_frames,
    frames_of_no_image,
)
from splatbus_conformance.cases.malformed.init_packets import changed
from splatbus_conformance.checks import CLIENT, CLIENT_DEVICE, CLIENT_HOST, Cases, Place, check
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import (
    TAKES_FRAMES_ON_DEVICE,
    FrameLender,
    lending,
    reading,
)
from splatbus_conformance.trials.trial import SETTLE_SECONDS
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

RETURNS = ("capability:frames", "returns:ipc")
LAST_NUMBER: int = LIMITS["max_safe_integer"]


@check(
    "IMG-12",
    on={
        CLIENT_HOST: ("capability:host_shm", "capability:frames"),
        CLIENT_DEVICE: TAKES_FRAMES_ON_DEVICE,
    },
    given=lending,
)
def check_releases_each_frame_once(trial: ClientTrial, _: Place, lender: FrameLender) -> None:
    """Frames are lent one after the other, in slots of any order, with numbers from the first to
    the last that there is and times before and after 0; each must be released once.
    """
    connection = lender.connection
    dealings = trial.with_(connection)
    many = 1000 if trial.thorough else 60
    for number in range(many):
        if number in (0, many - 1):
            seq = LAST_NUMBER if number else 0
            dealings.coming = trial.role.coming(connection)._replace(seq=seq)
        seq = trial.lend(connection, time=(number - 5) / 4)
        trial.expect(
            trial.releases(connection, seq),
            "not-released",
            f"frame {seq} was not released within 5 s",
        )
    trial.rest(0.1)
    twice = {seq for seq in dealings.released if dealings.released.count(seq) > 1}
    trial.expect(
        not twice, "released-twice", f"frame {min(twice, default=0)} was released more than once"
    )


@check("IMG-24", on={CLIENT: RETURNS}, may_crash=True)
def check_releases_frames_that_it_cannot_use(trial: ClientTrial) -> None:
    """Frames of slots that exist, whose camera, tag, objects or time is missing, of another type or
    impossible; a testee that closes the connection instead gives the slot back with it.
    """
    cases = list(broken_frames(trial.role.width, trial.role.height))
    for broken in trial.each(cases, kind=lambda case: case.kind):
        connection = reading_on(trial)
        frame = broken.of(trial.next_frame(connection))
        trial.role.say(connection, frame)
        given_back = trial.releases(connection, frame["seq"])
        what = f"a frame with {broken}"
        expect_alive(trial, connection, what)
        if not connection.ended:
            trial.expect(
                given_back, "not-released", f"{what}: its slot was not released within 5 s"
            )
        elif not given_back:
            trial.expect(
                trial.comes_back("ipc"), "closed-for-good", f"{what}: the testee closed, for good"
            )
    if not connection.ended:
        trial.expect(
            trial.releases(connection, trial.lend(connection)),
            "good-frame-not-released",
            "the good frame after them was not released",
        )


@check(
    "IMG-24",
    on={CLIENT: RETURNS},
    may_crash=True,
    cases=Cases((0, 1, 2, LAST_NUMBER)),
)
def check_releases_frames_whose_numbers_do_not_grow(trial: ClientTrial, back: int) -> None:
    """A frame has the number of the one before it, which was released, or a lesser one; a testee
    that closes the connection instead gives the slot back with it.
    """
    connection = reading(trial)
    dealings = trial.with_(connection)
    last = trial.lend(connection)
    if not trial.releases(connection, last):
        trial.not_observable("the testee did not release a good frame")
    seq = max(0, last - back)
    dealings.coming = trial.role.coming(connection)._replace(seq=seq)
    trial.lend(connection)
    due = dealings.frames.count(seq)
    trial.wait(lambda: dealings.released.count(seq) == due or connection.ended)
    what = f"frame {seq} after frame {last}"
    expect_alive(trial, connection, what)
    if not connection.ended:
        given_back = dealings.released.count(seq) == due
        trial.expect(given_back, "not-released", f"{what} was not released within 5 s")
    elif "ipc" in trial.facts.returns:
        trial.expect(trial.comes_back("ipc"), "closed-for-good", f"{what}: it closed, for good")


@check(
    "IMG-12",
    on={CLIENT: ("capability:frames", "capability:reinit", "opens")},
)
def check_releases_before_it_closes(trial: ClientTrial) -> None:
    """Frames that are followed at once by the init packet of other images, several times over."""
    connection = reading(trial)
    dealings = trial.with_(connection)
    widths = trial.role.width, max(1, trial.role.width // 2)
    for number in range(1, 100 if trial.thorough else 12):
        former, seq = dealings.generation, trial.lend(connection)
        trial.role.width = widths[number % 2]
        trial.role.offer(connection)
        closes = trial.closes(connection, former)
        expect_alive(trial, connection, "a further init packet while a frame is lent")
        if not closes or connection.ended:
            trial.not_observable(f"the testee did not close generation {former} (OPN-5)")
        said = [(m.get("type"), m.get("generation"), m.get("seq")) for m in dealings.heard]
        before = said[: said.index(("closed", former, None))]
        what = f"it closed generation {former}, and had not released its frame {seq}"
        trial.expect(("release", former, seq) in before, "closed-before-release", what)
    trial.expect(trial.opens(connection), "not-opened", "the last memory was not opened")


def of_no_image(trial: ClientTrial) -> Cases:
    """What is wrong with a frame that lends nothing. Numbers of `after` are added to the generation
    that is open; some look right in 32 bits.
    """
    wrap, slots = 1 << 32, trial.role.slots
    unknown = {
        "slot": (slots, slots + 1, -1, -slots, 0.5, *(wrap + slot for slot in range(slots))),
        "generation": (0, -1, LAST_NUMBER),
        "after": (-1, 1, 76, wrap),
    }
    listed = [
        BrokenFrame(f"{name} {number}", {name: number})
        for name, numbers in unknown.items()
        for number in numbers
    ]
    return Cases([*listed, *frames_of_no_image()], kind=lambda case: case.kind)


@check("IMG-15", on={CLIENT: RETURNS}, cases=of_no_image, may_crash=True)
def check_ignores_frames_of_no_image(trial: ClientTrial, broken: BrokenFrame) -> None:
    """Frames of generations that were never announced, and of slots beyond the ring; and those
    whose generation, slot or number is missing, of another type, or none that may be. None is
    released, and the good one after it is.
    """
    connection = reading_on(trial)
    good, changes = trial.next_frame(connection), dict(broken.changes)
    if "after" in changes:
        changes = {"generation": good["generation"] + changes["after"]}
    judge_bad_frame(trial, connection, f"a frame with {broken}", changed(good, changes))


@check(
    "IMG-15",
    on={CLIENT: (*RETURNS, "capability:reinit")},
    may_crash=True,
)
def check_ignores_frames_of_closed_memory(trial: ClientTrial) -> None:
    """Further memory is announced, and when the former is closed, a frame of that still comes."""
    for _ in range(3):
        connection = reading_on(trial)
        former = trial.with_(connection).generation
        trial.role.offer(connection)
        if not (trial.closes(connection, former) or connection.ended):
            expect_alive(trial, connection, "a further init packet")
            trial.not_observable(f"the testee did not close generation {former} (OPN-5)")
        bad = trial.next_frame(connection) | {"generation": former}
        judge_bad_frame(trial, connection, "a frame of closed memory", bad)


def reading_on(trial: ClientTrial) -> Connection:
    """The connection on which the testee reads frames, if there is one still, or a new one."""
    known = trial.role.dealings.items()
    there = (it for it, of in known if not it.gone and of.generation in of.opened)
    return next(there, None) or reading(trial)


def expect_alive(trial: ClientTrial, connection: Connection, what: str) -> None:
    """A testee that has ended violates the requirement, also if that shows only a moment later."""
    if connection.ended:
        trial.wait(trial.fate, SETTLE_SECONDS)
    if fate := trial.fate():
        trial.judge(fate, what)


def judge_bad_frame(trial: ClientTrial, connection: Connection, what: str, bad: Json) -> None:
    """Send a frame that lends nothing, then a good one, and judge what came of them."""
    dealings = trial.with_(connection)
    before = dealings.count("release")
    trial.role.say(connection, bad)
    good = trial.role.lend(connection)
    trial.releases(connection, good)
    if dealings.count("release") > before + (good in dealings.released):
        outcome = "accepts"
    elif good in dealings.released:
        outcome = "ignores"
    elif connection.ended and not trial.fate():
        outcome = "closes" if trial.comes_back("ipc") else "hangs"
    else:
        outcome = "hangs"
    trial.judge(outcome, what)
