"""Has a server render for cameras that the harness chose, and copies the images that it lends."""

import time

import numpy as np

from splatbus_conformance.messages import Json, camera_pose
from splatbus_conformance.photographs import Photograph, photograph_of
from splatbus_conformance.server_trial import ServerTrial
from splatbus_conformance.stress import Pose
from splatbus_conformance.trial import EFFECT_SECONDS

CLOSENESS = 1e-5
"""How far a position that a frame names may be from the one that was sent, absolute or relative."""
AGAIN_SECONDS = 0.5
"""After which poses are sent again, as viewers do: a connection that held control may linger."""
STILL_SECONDS = 1.0
"""A server that sent frames, and then none for so long, has shown what it makes of a pose."""
AT_REST = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class Photographer:
    """Moves the camera and the Gaussians, and reads what the server makes of it."""

    def __init__(self, trial: ServerTrial) -> None:
        self.trial = trial
        trial.viewer.releases = False
        self.reader = trial.reading()
        self.dealings = trial.viewer.with_(self.reader)
        self._seen = 0
        self._scene = ""

    def take(self, camera: Pose, scene: Pose | None = AT_REST) -> Photograph:
        """What the server shows for a camera, with the Gaussians as `scene` says (None: as they
        are). The camera has to be at another position than for the image before.

        Of images that name another position, it is the last; skips the check if there is none.
        """
        before, last = self._seen, None
        sent, until = 0.0, time.monotonic() + EFFECT_SECONDS
        while (now := time.monotonic()) < until and not self.reader.ended:
            if now - sent > AGAIN_SECONDS:
                if scene is not None:
                    self.trial.move(camera_pose(*scene, kind="point_cloud_pose"))
                self.trial.move(camera_pose(*camera))
                sent = now
            self.trial.wait(self._came, min(AGAIN_SECONDS, until - now))
            for photograph in self._new():
                last, until = photograph, min(until, time.monotonic() + STILL_SECONDS)
                if self.shows(last, camera):
                    self.trial.delivered += 1
                    return last
            if self.trial.fate():
                break
        if last is None:
            came = "another frame" if self._seen > before else "no frame"
            self.trial.not_observable(f"the server sent {came} after the camera had been moved")
        return last

    @staticmethod
    def shows(photograph: Photograph, camera: Pose) -> bool:
        """Whether the frame names this position; of the rotation it need not be sure."""
        named, wanted = photograph.pose.position, np.array(camera.position)
        return bool(np.allclose(named, wanted, rtol=CLOSENESS, atol=CLOSENESS))

    def hold(self) -> Photograph:
        """The next image, not given back; skips the check if none comes."""
        self.trial.wait(lambda: self._came() or self.reader.ended)
        if not self._came():
            self.trial.not_observable("the server sent no further frame")
        photograph = self._copy(self.dealings.frames[self._seen])
        self._seen += 1
        if photograph is None:
            self.trial.not_observable("the server sent a frame that cannot be read")
        return photograph

    def again(self, photograph: Photograph) -> Photograph:
        """What lies in the slot of an image that is held still."""
        copy = self._copy(photograph.frame)
        if copy is None:
            self.trial.not_observable("the server has announced other memory")
        return copy

    def give_back(self, photograph: Photograph) -> None:
        """Release an image that was held."""
        self.trial.viewer.release(self.reader, photograph.frame)

    def _came(self) -> bool:
        return len(self.dealings.frames) > self._seen

    def _new(self) -> list[Photograph]:
        """Copies of the images that came since, which are given back."""
        found = []
        while self._came():
            frame = self.dealings.frames[self._seen]
            self._seen += 1
            if (photograph := self._copy(frame)) is not None:
                found.append(photograph)
            self.trial.viewer.release(self.reader, frame)
        return found

    def _copy(self, frame: Json) -> Photograph | None:
        if self.dealings.memory is None or not self.dealings.init_packets:
            return None
        return photograph_of(frame, self.dealings.memory, self.dealings.init_packets[-1])
