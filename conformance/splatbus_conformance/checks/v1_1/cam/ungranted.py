"""Checks on intrinsics that were not granted (spec 1.1 section 6.2)."""

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.v1_1.cam.lenses import in_force, turned_elsewhere
from splatbus_conformance.trials.moves.image_session import LENS, NARROW, ImageSession, errors_after
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.json_values import show
from splatbus_conformance.wire.messages import camera_pose, encode, intrinsics


@check(
    "CAM-10",
    observable="the lens that the frames name that follow",
    on={SERVER: ("1.1", "frames", "pixels")},
)
def check_uses_no_lens_that_was_not_granted(trial: ServerTrial) -> None:
    """A client that did not ask for `intrinsics` sends some, of two shapes."""
    offered = [it for it in trial.viewer.capabilities["msg"] if it != "intrinsics"]
    session = ImageSession(trial, capabilities=offered)
    own = {name: session.frames[-1]["camera"][name] for name in LENS}
    for lens in trial.each([intrinsics(*trial.facts.size), NARROW]):
        known = len(session.frames)
        pose = camera_pose(*turned_elsewhere(trial)) | {"intrinsics": lens}
        errors, goes_on = errors_after(trial, session.poser, encode(pose))
        what = f"a pose with the lens {show(lens)}, which was not granted"
        trial.expect(goes_on, "no-longer-served", f"{what}: the next request was not answered")
        other = next(filter(None, (in_force(it, own) for it in session.nudged(known - 1))), "")
        trial.expect(not other, "lens-in-force", f"{what}; {other}")
        trial.judge("reports" if errors else "ignores", what)
        trial.delivered += 1
