"""How a server of 1.0 takes poses, by its images in CUDA memory: good ones and others."""

from pathlib import Path

import pytest
from splatbus_conformance.checks.v1_0 import cnv, pos
from splatbus_conformance.checks.v1_0.buf import servers as buf

from tests.conformance.images.cuda_stand_in.library import in_device_memory, judged

MINIATURES = Path(__file__).parents[1] / "miniatures"
OF_SCENE, OF_WALL = MINIATURES / "cuda_scene_server.py", MINIATURES / "cuda_server.py"
CHECKS = in_device_memory(buf, cnv, pos)
BROKEN = {
    "stores the top row first": (
        "image.color[::-1].tobytes(), image.depth[::-1].tobytes()",
        "image.color.tobytes(), image.depth.tobytes()",
        "check_rows_are_bottom_up",
        "rows stored top-down",
    ),
    "stores inverse depths": (
        "image.depth[::-1].tobytes()",
        "(1.0 / image.depth[::-1]).tobytes()",
        "check_depth_is_planar",
        "inverse depths",
    ),
    "takes poses for world-to-camera": (
        "    return turn, place\n",
        "    return turn.T, -turn.T @ place\n",
        "check_poses_are_camera_to_world",
        "taken for world-to-camera",
    ),
    "takes the first number of a rotation for its scalar": (
        'for name in "xyzw"])).reshape',
        'for name in "yzwx"])).reshape',
        "check_rotations_are_hamilton_with_w_last",
        "read as w, x, y, z",
    ),
    "takes a rotation in the order in which it comes": (
        '[float(rotation[name]) for name in "xyzw"]',
        "[float(number) for number in rotation.values()]",
        "check_takes_members_by_name",
        "ignored it and went on",
    ),
    "takes a rotation of any norm": (
        "abs(math.hypot(*rotation) - 1.0) <= 0.01",
        "math.hypot(*rotation) > 0.5",
        "check_keeps_the_former_pose",
        "a rotation of norm",
    ),
    "takes the first of several poses": (
        "                self.poses[kind] = message\n",
        "                if time.monotonic() - getattr(self, kind, 0.0) > 0.03:\n"
        "                    self.poses[kind] = message\n"
        "                setattr(self, kind, time.monotonic())\n",
        "check_the_last_of_one_piece_is_shown",
        "no image is of the last",
    ),
    "takes everybody's poses": (
        "            if self.controls[0] is sock:\n",
        "            if self.controls:\n",
        "check_one_connection_has_control",
        "that has no control",
    ),
    "begins with a scene that was moved": (
        "    scene, camera = (poses",
        '    moved = ORIGIN | {"position": dict.fromkeys("xyz", 0.5)}\n'
        '    poses = {"point_cloud_pose": moved} | poses\n'
        "    scene, camera = (poses",
        "check_the_scene_of_a_new_server_is_at_rest",
        "not at rest before",
    ),
    "takes strings for the numbers of a position alone": (
        "        timed = is_number",
        '        if isinstance(message.get("position", {}).get("x"), str):\n'
        '            place = {n: float(v) for n, v in message["position"].items()}\n'
        "            self.poses[kind] = self.poses[kind] | {'position': place}\n"
        "        timed = is_number",
        "check_takes_strings_for_numbers_or_not",
        "applied it",
    ),
}


def test_a_server_that_takes_poses_as_it_should_passes_every_check() -> None:
    assert judged("server", OF_SCENE, CHECKS) == dict.fromkeys(CHECKS, "")


@pytest.mark.parametrize("name", BROKEN)
def test_a_server_that_takes_poses_otherwise_fails(name: str, tmp_path: Path) -> None:
    old, new, check, why = BROKEN[name]
    sources = {path: path.read_text("utf-8") for path in (OF_SCENE, OF_WALL)}
    assert any(old in source for source in sources.values())
    for path, source in sources.items():
        (tmp_path / path.name).write_text(source.replace(old, new), "utf-8")
    assert why in judged("server", tmp_path / OF_SCENE.name, {check: CHECKS[check]})[check]
