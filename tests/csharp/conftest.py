from pathlib import Path

import pytest

from tests.csharp.compiled import compiled


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(tmp_path_factory.mktemp("csharp") / "vectors.exe")
