"""The sample that draws with OpenGL, on the processor where there is no GPU."""

from pathlib import Path

import pytest
from splatbus_server import Semantics

from tests.engines.pictures import SEMANTICS, check_picture


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_it_draws_what_the_python_viewer_composes(semantics: Semantics, tmp_path: Path) -> None:
    check_picture(tmp_path / "it.png", semantics, lambda *planes: planes, "memory of the host")
