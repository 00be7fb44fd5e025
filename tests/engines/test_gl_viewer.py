"""The sample that draws with OpenGL, on the processor where there is no GPU."""

from pathlib import Path

import pytest
from splatbus_server import Semantics

from tests.engines.pictures import SEMANTICS, check_picture, gl_viewer


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return gl_viewer(tmp_path_factory.mktemp("gl"))


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_it_draws_what_the_python_viewer_composes(program: Path, semantics: Semantics) -> None:
    check_picture(program, semantics, lambda *planes: planes, "memory of the host")
