"""Checks on `tag`, by which a client learns which image shows its pose (spec 1.1 section 6.1)."""

import itertools
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import STEP
from splatbus_conformance.trials.moves.camera_control import CameraControl
from splatbus_conformance.trials.moves.frame_readers import LENDS, gave_way, joined
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import finites, show, whole, within
from splatbus_conformance.wire.messages import Json, camera_pose
from splatbus_conformance.wire.sockets import Connection

LONGEST: int = LIMITS["max_tag_chars"]
PADDING = ("", "-", '"\\/', "\x00\x1f", "é\u202e中", "🙂" * LONGEST, "t" * LONGEST, " ", "null")
"""What follows the number of a tag, cut at its greatest length."""
HEIGHT, DEPTH = -1.5, -2.5
USUAL = ("tagged", "scene", "join", "burst", "scene", "again", "plain", "again", "tagged", "join")
ACTIONS = tuple(dict.fromkeys(USUAL))
BURST = 5
MOST_READERS = 3
_tags = itertools.count()
"""No two tags are the same: the server may show an image of a pose from long ago."""


class TaggedPose(NamedTuple):
    """A pose that was sent: the number of its place, and its tag."""

    place: int
    tag: str | None


class TagSession:
    """Poses of one client, and what frames say of them to several readers."""

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial
        self.steering = CameraControl(trial)
        self.poser = trial.commanding()
        self.readers = [self.steering.reader]
        self.sent: list[TaggedPose] = []
        shown = self.steering.shows(self.poser, _pose(0))
        trial.expect(shown, "not-applied", "no frame shows a good pose")
        self._begun = {self.steering.reader: self.steering.count}

    def go_through(self, actions: Iterable[str]) -> None:
        """Take each step, and wait until every reader has seen what came of it."""
        for action in actions:
            if action == "join":
                self._join()
            elif action == "scene":
                self.steering.nudged(self.poser)
            elif action == "again" and self.sent:
                self._send(self.sent[-1].place, tagged=True)
                self.steering.nudged(self.poser)
            else:
                for _ in range(BURST if action == "burst" else 1):
                    self._send(len(self.sent) + 1, tagged=action != "plain")
            self._settle()

    def told(self, reader: Connection) -> list[tuple[int | None, object]]:
        """For each frame to a reader, the place of its camera, and its tag; None without one."""
        frames = self.trial.with_(reader).frames[self._begun.get(reader, 0) :]
        return [(_place(frame), within(frame, "camera", "tag")) for frame in frames]

    def _send(self, place: int, *, tagged: bool) -> None:
        padding = PADDING[len(self.sent) % len(PADDING)]
        tag = f"{next(_tags)}{padding}"[:LONGEST] if tagged else None
        self.sent.append(TaggedPose(place, tag))
        added: Json = {"tag": tag} if tagged else {}
        self.trial.viewer.say(self.poser, _pose(place) | added)

    def _join(self) -> None:
        if len(self.readers) == MOST_READERS:
            self.readers.pop().close()
        if reader := joined(self.trial):
            self.readers.append(reader)

    def _settle(self) -> None:
        """Every reader has a frame of the newest camera, and the newest of all frames."""
        if ended := [reader for reader in self.readers if reader.ended]:
            later = all(gave_way(self.trial, reader) for reader in ended)
            self.trial.expect(
                later, "closes", "a reader was closed, and no other had come after it"
            )
            self.trial.not_observable("the server ends a connection in favour of a later one")
        place = self.sent[-1].place if self.sent else 0

        def newest() -> list[Json]:
            return [it for each in self.readers for it in self.trial.with_(each).frames[-1:]]

        def settled() -> bool:
            frames = newest()
            shown = {(_place(it), whole(it.get("seq"))) for it in frames}
            return len(frames) == len(self.readers) and [at for at, _ in shown] == [place]

        if not self.trial.wait(settled):
            self.trial.expect(
                all(_place(frame) == place for frame in newest()),
                "not-the-newest",
                "a reader is shown no image of the newest camera",
            )
            self.trial.not_observable("its readers are never shown the same image")


def stories(trial: ServerTrial) -> Iterator[TagSession]:
    """One story whose steps are always the same, then some that are drawn."""
    drawn = st.lists(st.sampled_from(ACTIONS), min_size=1, max_size=8)
    for actions in trial.each([USUAL], drawn, quick=2, full=60):
        trial.peer.close_all()
        story = TagSession(trial)
        story.go_through(actions)
        yield story


@check("CAM-2", on={SERVER: LENDS})
def check_tags_come_with_the_first_image(trial: ServerTrial) -> None:
    """Poses with tags and without, some overtaken, some the same again; readers come at any time,
    and the first frame of each that shows a pose has its tag.
    """
    for story in stories(trial):
        for number, reader in enumerate(story.readers, 1):
            told = story.told(reader)
            for place in dict.fromkeys(at for at, _ in told):
                poses = [it for it in story.sent if it.place == place]
                tags = [tag for at, tag in told if at == place]
                if not poses or poses[-1].tag is None:
                    continue
                what = f"pose {place} of {len(story.sent)}, with tag {show(poses[-1].tag)},"
                if len(poses) == 1:
                    trial.expect(
                        tags[0] == poses[0].tag,
                        "another-tag",
                        f"the first frame to reader {number} of {what} has {_named(tags[0])}",
                    )
                trial.expect(
                    poses[-1].tag in tags,
                    "no-tag",
                    f"no frame to reader {number} has the tag of {what} which has the values of the"
                    " pose before it",
                )


@check(
    "CAM-2",
    on={SERVER: LENDS},
    given=lambda trial: (TagSession(trial), f"{next(_tags)} again"),
    cases=Cases(range(1, 4)),
)
def check_a_tag_that_was_used_comes_again(
    trial: ServerTrial, given: tuple[TagSession, str], place: int
) -> None:
    """Poses of different places with the same tag, each sent when the one before was shown."""
    story, tag = given
    frames = trial.with_(story.steering.reader).frames
    before = len(frames)
    trial.viewer.say(story.poser, _pose(place) | {"tag": tag})
    shown = trial.wait(lambda: any(_place(it) == place for it in frames[before:]))
    trial.expect(shown, "not-applied", "no frame shows a good pose")
    came = within(next(it for it in frames[before:] if _place(it) == place), "camera", "tag")
    told = f"pose {place} has the tag of the pose before, and the first frame of it has"
    trial.expect(came == tag, "another-tag", f"{told} {_named(came)}")


@check("CAM-3", on={SERVER: LENDS})
def check_no_other_tags_come(trial: ServerTrial) -> None:
    """The same: no tag comes twice on a connection, with another pose, or that no pose had."""
    for story in stories(trial):
        places: dict[object, int] = {it.tag: it.place for it in story.sent if it.tag is not None}
        for number, reader in enumerate(story.readers, 1):
            came: list[object] = []
            for place, tag in story.told(reader):
                if tag is None:
                    continue
                what = f"a frame to reader {number} has {_named(tag)}, which"
                trial.expect(
                    isinstance(tag, str) and tag in places,
                    "unknown-tag",
                    f"{what} no pose had",
                )
                trial.expect(
                    tag not in came, "tag-twice", f"{what} had come on that connection already"
                )
                trial.expect(
                    place == places[tag],
                    "tag-of-another-pose",
                    f"{what} belongs to pose {places[tag]}, and the image is of pose {place}",
                )
                came.append(tag)


def _pose(place: int) -> Json:
    return camera_pose((STEP * place, HEIGHT, DEPTH))


def _named(tag: object) -> str:
    return "no tag" if tag is None else f"tag {show(tag)}"


def _place(frame: Json) -> int | None:
    position = finites(within(frame, "camera", "position"), 3)
    return None if position is None else round(position[0] / STEP)
