"""The C++ client with real handles: judged at L3, and its sample with OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from splatbus_server import Semantics

from tests.engines.built import Command, built
from tests.engines.pictures import SEMANTICS, check_picture
from tests.gpu import require_gpu

require_gpu()

from splatbus_server.cuda.driver import Device  # noqa: E402

from tests.gpu.images import OnDevice  # noqa: E402
from tests.gpu.test_judging import CLIENT, of_client  # noqa: E402


@pytest.fixture(scope="module")
def adapter(tmp_path_factory: pytest.TempPathFactory) -> Command:
    return built("cpp", "Adapter", tmp_path_factory.mktemp("cpp"), sanitized=False)


@pytest.mark.parametrize("words", ["opengl", "unreal device"])
def test_it_conforms(words: str, adapter: Command) -> None:
    assert of_client(f"{adapter[0]} {words}", CLIENT) == dict.fromkeys(CLIENT, "")


@pytest.mark.parametrize("semantics", SEMANTICS)
def test_the_sample_draws_what_the_python_viewer_composes(
    semantics: Semantics, tmp_path: Path
) -> None:
    check_picture(tmp_path / "it.png", semantics, uploading(), "CUDA", memory="cuda_ipc")


def uploading() -> Callable[..., Any]:
    """What makes of an image of the host one on the GPU."""
    kept: list[OnDevice] = []

    def published(*planes: Any) -> tuple[Any, ...]:
        if not kept:
            with Device(0).current():
                kept.extend(map(OnDevice, planes))
        return tuple(kept)

    return published
