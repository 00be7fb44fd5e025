from pathlib import Path

import pytest

from tests.engines.built import LANGUAGES, Command, built


@pytest.fixture(scope="session", params=LANGUAGES)
def language(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session")
def program(language: str, tmp_path_factory: pytest.TempPathFactory) -> Command:
    """The test program of a client."""
    return built(language, "Tests", tmp_path_factory.mktemp(language))


@pytest.fixture(scope="session")
def folder(language: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp(f"{language}-programs")


@pytest.fixture(scope="session")
def cpp_adapter(tmp_path_factory: pytest.TempPathFactory) -> Command:
    return built("cpp", "Adapter", tmp_path_factory.mktemp("cpp-adapter"))
