"""The list of foreign programs agrees with itself."""

import pytest
from splatbus_schemas.requirements import requirements

from tests.foreign.programs import Program, programs

PROGRAMS = [*programs("client"), *programs("server")]
LINES = {"client": 410, "server": 820}
each = pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.name)


@each
def test_its_pins_are_what_its_defects_break(program: Program) -> None:
    broken = {name for defect in program.defects for name in (defect.requirement, *defect.also)}
    assert broken == program.fails | program.warns
    assert program.conforms == (not program.fails and not program.exit)


@each
def test_a_broken_must_fails_and_a_broken_should_warns(program: Program) -> None:
    levels = {name: requirement.level for name, requirement in requirements("1.1").items()}
    assert {levels[name] for name in program.fails} <= {"MUST", "MUST NOT"}
    assert {levels[name] for name in program.warns} <= {"SHOULD", "SHOULD NOT"}


@each
def test_it_is_small_and_shares_no_code_with_ours(program: Program) -> None:
    sources = [path for path in program.folder.iterdir() if path.suffix != ".toml"]
    texts = [path.read_text("utf-8") for path in sources]
    assert sum(len(text.splitlines()) for text in texts) <= LINES[program.side]
    assert not any("splatbus_" in text for text in texts)
