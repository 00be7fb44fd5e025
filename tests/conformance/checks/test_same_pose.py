"""How a server of 1.0 takes poses, by its images of a scene that nobody knows."""

from pathlib import Path

import pytest

from tests.conformance.checks.test_device_poses import BROKEN, CHECKS, OF_SCENE, OF_WALL
from tests.conformance.images.cuda_stand_in.library import judged

pytestmark = pytest.mark.apart

STRANGE = (
    "shown = default_scene()\n",
    "shown = default_scene()\n    shown = type(shown)(shown.spheres[1:4], None, shown.light)\n",
)
"""Three spheres before nothing."""
SLOW = ("FRAME_SECONDS = 0.03", "FRAME_SECONDS = 0.25")
BY_POSE = {
    name: check for name, check in CHECKS.items() if check.requirement.startswith(("POS", "JSN"))
}
OF_POSES = {name: broken for name, broken in BROKEN.items() if broken[2] in BY_POSE}


def program(folder: Path, *changes: tuple[str, str]) -> Path:
    """The miniature with these changes, each of which is one."""
    sources = {path.name: path.read_text("utf-8") for path in (OF_SCENE, OF_WALL)}
    for old, new in changes:
        assert any(old in source for source in sources.values()), old
        sources = {name: source.replace(old, new) for name, source in sources.items()}
    for name, source in sources.items():
        (folder / name).write_text(source, "utf-8")
    return folder / OF_SCENE.name


@pytest.mark.parametrize("scene", [(), (STRANGE,)], ids=["known", "strange"])
def test_a_server_that_draws_four_times_a_second_passes_every_check(
    scene: tuple[tuple[str, str], ...], tmp_path: Path
) -> None:
    slow = program(tmp_path, SLOW, *scene)
    assert judged("server", slow, BY_POSE) == dict.fromkeys(BY_POSE, "")


@pytest.mark.parametrize("name", OF_POSES)
def test_a_server_of_a_strange_scene_that_takes_poses_otherwise_fails(
    name: str, tmp_path: Path
) -> None:
    old, new, check, why = OF_POSES[name]
    strange = program(tmp_path, STRANGE, (old, new))
    assert why in judged("server", strange, {check: BY_POSE[check]})[check]


def test_of_a_scene_that_moves_by_itself_nothing_is_told(tmp_path: Path) -> None:
    turns = (
        "    matrix = tuple(map(tuple, turn.tolist()))\n",
        "    place = place + [0.1 * number, 0.0, 0.0]\n"
        "    matrix = tuple(map(tuple, turn.tolist()))\n",
    )
    restless = program(tmp_path, STRANGE, turns)
    check = "check_takes_members_by_name"
    found = judged("server", restless, {check: BY_POSE[check]})[check]
    assert found.startswith("skipped: ")
