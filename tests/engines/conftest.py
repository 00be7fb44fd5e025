from pathlib import Path

import pytest

from tests.engines.built import LANGUAGES, LIBCXX, Command, built


@pytest.fixture(scope="session", params=LANGUAGES)
def language(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="session", params=[*LANGUAGES, LIBCXX])
def program(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Command:
    """The test program of a client, in C++ with each standard library."""
    return built(request.param, "Tests", tmp_path_factory.mktemp("tests"))


@pytest.fixture(scope="session")
def folder(language: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp(f"{language}-programs")


@pytest.fixture(scope="session")
def cpp_adapter(tmp_path_factory: pytest.TempPathFactory) -> Command:
    return built("cpp", "Adapter", tmp_path_factory.mktemp("cpp-adapter"))
