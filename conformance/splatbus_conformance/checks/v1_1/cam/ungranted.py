"""Checks on intrinsics that were not granted (spec 1.1 section 6.2)."""

from splatbus_conformance.checks import check
from splatbus_conformance.checks.v1_1.cam.lenses import turned_elsewhere, what_was_applied
from splatbus_conformance.trials.moves.image_session import NARROW, ImageSession, errors_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import camera_pose, encode, intrinsics


@check(
    "CAM-10",
    observable="the error, and the cameras of the frames that follow",
    needs=("1.1", "frames", "pixels"),
)
def check_refuses_a_lens_that_was_not_granted(trial: ServerTrial) -> None:
    """A client that did not ask for `intrinsics` sends some, of two shapes."""
    offered = [it for it in trial.viewer.capabilities["msg"] if it != "intrinsics"]
    session = ImageSession(trial, capabilities=offered)
    for lens in trial.each([intrinsics(*trial.facts.size), NARROW]):
        known = len(session.frames)
        pose = camera_pose(*turned_elsewhere(trial)) | {"intrinsics": lens}
        errors, goes_on = errors_after(trial, session.poser, encode(pose))
        what = f"a pose with the lens {show(lens)}, which was not granted"
        trial.expect(goes_on, "no-longer-served", f"{what}: the next request was not answered")
        former, *frames = session.nudged(known - 1)
        applied = what_was_applied(former, frames)
        trial.expect(not applied, "applied", f"{what}; {applied}")
        told = [(it.get("code"), it.get("pointer")) for it in errors]
        reported = ("unsupported", "/intrinsics") in told
        trial.judge("reports" if reported else "ignores", f"{what}; the errors are {show(told)}")
        trial.delivered += 1
