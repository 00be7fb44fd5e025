"""What draws the scene of `conformance/SCENE.md`."""

from splatbus_renderer import cli, demo
from splatbus_renderer.raycast import Raycaster

from tests.zoo.faults.seam import Seam

SERVES = Seam(cli, "serve")
RENDERS_UNTIL_TOLD = Seam(cli, "render_until")
DEFAULT_SCENE = Seam(demo, "default_scene")
CAMERA_OF_VIEW = Seam(demo, "camera_of")
POSE_IN_VIEW = Seam(demo, "object_pose_of")
ROWS_OF_ROTATION = Seam(demo, "matrix_of")
RENDERS_IMAGE = Seam(Raycaster, "render")
