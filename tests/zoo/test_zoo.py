"""The zoo: it fits the checks, its verdicts can go wrong, a few specimens run."""

import importlib
import inspect
import json
import pkgutil
import re
from collections import Counter
from dataclasses import replace

import pytest
from splatbus_conformance import rules
from splatbus_conformance.checks.registry import checks_of, judges
from splatbus_schemas.prose import CHECKOUT as ROOT
from splatbus_schemas.requirements import requirements

from tests.zoo import __main__ as zoo
from tests.zoo import judge, kill_matrix, schedule
from tests.zoo.homes import HOMES, Home, Judge
from tests.zoo.judge import Cell, Fate, SpecimenResult, fate_of
from tests.zoo.mutant import RULE, SIDES, Kind, Specimen
from tests.zoo.registry import (
    HAS_CUDA,
    REFERENCES,
    groups,
    mutants,
    specimen_named,
    specimens,
    variations,
)

EVERY = {mutant.name: mutant for mutant in mutants()}
MUTANTS = {name: it for name, it in EVERY.items() if it.home.judge is not Judge.SIMULATION}
VARIATIONS = {variation.name: variation for variation in variations()}
JUDGES = {side: judges(side) for side in SIDES}
WITHOUT_A_MUTANT = {"client": {"INI-12"}, "server": set()}
"""Permissions cannot be broken."""


def judged_by(mutant: Specimen) -> set[str]:
    """The checks, or the rules, that can kill this mutant."""
    if mutant.check != RULE:
        return {mutant.check}
    return {it.name for it in JUDGES[mutant.side][mutant.requirement] if it.level == "L0"}


def families(package):
    """Each module of a package with the names of the functions in it."""
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(found.name)
        functions = inspect.getmembers(module, inspect.isfunction)
        yield found.name, {name for name, f in functions if f.__module__ == module.__name__}


def test_each_module_of_specimens_has_its_home():
    """Else nobody would judge what it declares."""
    folders = [ROOT / "tests" / "zoo" / name for name in ("mutants", "variations")]
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    declare = re.compile(r"^@(?:mutant|variation|together)\b", re.M)
    found = {str(path.relative_to(ROOT)) for path in paths if declare.search(path.read_text())}
    assert found == {f"{module.replace('.', '/')}.py" for module in HOMES}


def test_every_specimen_has_a_name_of_its_own():
    names = Counter(it.name for it in specimens())
    assert [name for name, count in names.items() if count > 1] == []


def test_each_mutant_names_a_requirement_who_judges_it_and_for_what():
    def fits(mutant: Specimen) -> bool:
        judging = JUDGES[mutant.side][mutant.requirement]
        known = {(RULE if it.level == "L0" else it.name) for it in judging}
        binds = requirements("1.1")[mutant.requirement].binds
        return mutant.side in binds and mutant.check in known and bool(mutant.code)

    assert [name for name, mutant in MUTANTS.items() if not fits(mutant)] == []


def test_each_mutant_runs_through_a_requirement_that_has_a_check():
    has = {side: {it.requirement for it in checks_of(side)} for side in SIDES}

    def runs(mutant: Specimen) -> bool:
        direct = mutant.check == RULE or mutant.through == mutant.requirement
        return mutant.through in has[mutant.side] and direct

    assert [name for name, mutant in MUTANTS.items() if not runs(mutant)] == []


def test_each_specimen_can_be_made_of_the_reference_as_it_is():
    def made(specimen: Specimen) -> bool:
        try:
            with pytest.MonkeyPatch.context() as patch:
                specimen.alter(patch)
        except AttributeError:
            return False
        return True

    assert [it.name for it in specimens() if not made(it)] == []


class Noted(pytest.MonkeyPatch):
    """Remembers what was replaced, but for what goes on doing what it did as well."""

    def __init__(self) -> None:
        super().__init__()
        self.replaced: list[tuple[int, str]] = []

    def setattr(self, owner, name, value, raising=True):
        if not hasattr(value, "__wrapped__"):
            self.replaced.append((id(owner), name))
        super().setattr(owner, name, value, raising)


def test_no_liberty_of_a_group_takes_another_away():
    for group in groups():
        patch = Noted()
        try:
            group.alter(patch)
        finally:
            patch.undo()
        twice = [name for name, count in Counter(patch.replaced).items() if count > 1]
        assert twice == [], group.name


def test_each_liberty_is_in_one_group_at_most():
    assert max(Counter(name for group in groups() for name in group.members).values()) == 1


def test_the_advice_that_a_variation_breaks_is_advice():
    levels = {requirements("1.1")[name].level for v in variations() for name in v.warns}
    assert levels <= {"SHOULD", "SHOULD NOT"}


def test_every_family_of_rules_has_a_mutant():
    killers = {killer for mutant in MUTANTS.values() for killer in judged_by(mutant)}
    judging = {rule.__name__ for rule in rules.all_rules()}
    for family, functions in families(rules):
        assert functions & killers or not functions & judging, f"no mutant for {family}"


@pytest.mark.parametrize("side", SIDES)
def test_every_requirement_that_is_judged_has_a_mutant(side):
    broken = {m.requirement for m in MUTANTS.values() if m.side == side}
    assert broken == {*JUDGES[side]} - WITHOUT_A_MUTANT[side]


@pytest.mark.parametrize("side", SIDES)
def test_every_check_has_a_mutant(side):
    here = {(m.requirement, m.check) for m in MUTANTS.values() if m.side == side}
    there = {(it.requirement, it.name) for it in checks_of(side)}
    assert {name for name, _ in there - here} <= WITHOUT_A_MUTANT[side]


@pytest.mark.skipif(not HAS_CUDA, reason="without cuda-bindings there are fewer")
def test_the_stored_kill_matrix_is_of_the_specimens_that_there_are():
    as_declared = kill_matrix.as_declared() == kill_matrix.PAGE.read_text("utf-8")
    assert as_declared, "python -m tests renew writes it"


def test_of_a_requirement_are_judged_who_breaks_it_and_whom_it_binds():
    chosen = [schedule.named()[name] for name in schedule.usual("VPT-6")[0]]
    broken = [it for it in chosen if it.kind is Kind.MUTANT]
    assert broken == [it for it in mutants() if it.requirement == "VPT-6"]
    assert {it.side for it in chosen} == {"server"}
    assert len(chosen) > 2 * len(broken) > 0


MUTANT = Specimen(
    *("m", "breaks it", lambda patch: None, Kind.MUTANT, Home("client")),
    *("", "FRM-3", "check_it", "too-long", "FRM-3"),
)


@pytest.mark.parametrize(
    ("cell", "fate"),
    [
        (Cell("FRM-3", "check_it", "fail", "that is too long", "too-long"), Fate.KILLED),
        (Cell("FRM-3", "check_it", "warn", "that is too long", "too-long"), Fate.KILLED),
        (Cell("FRM-3", "check_it", "fail", "its process ended", "dies"), Fate.MISTAKEN),
        (Cell("FRM-3", "check_other", "fail", "that is too long", "too-long"), Fate.MISTAKEN),
        (Cell("FRM-3", "check_it", "pass", "that is too long", "too-long"), Fate.SURVIVED),
        (Cell("FRM-3", "check_it", "skip", "that is too long", "too-long"), Fate.SURVIVED),
        (Cell("FRM-4", "check_it", "fail", "that is too long", "too-long"), Fate.SURVIVED),
    ],
)
def test_a_mutant_is_killed_by_its_check_with_its_code_alone(cell, fate):
    assert fate_of(MUTANT, [cell]) is fate


def row(name, fate, kind=Kind.MUTANT):
    return SpecimenResult(replace(MUTANT, name=name, kind=kind), fate)


def test_it_fails_when_a_mutant_survives(capsys):
    assert zoo.told([row("killed-one", Fate.KILLED), row("other-one", Fate.SURVIVED)]) == 1
    text = capsys.readouterr().out
    assert "1 of 2 mutants killed" in text
    assert "SURVIVED  other-one" in text


def test_it_passes_when_all_is_as_it_must_be():
    assert (
        zoo.told([row("killed-one", Fate.KILLED), row("usual", Fate.ALLOWED, Kind.VARIATION)]) == 0
    )


@pytest.mark.parametrize("alone", [Fate.ALLOWED, Fate.CONDEMNED])
def test_a_group_that_is_condemned_is_judged_one_by_one(monkeypatch, alone):
    (group, *_) = groups()
    fates = dict.fromkeys(group.members, Fate.ALLOWED)
    fates |= {group.name: Fate.CONDEMNED, group.members[0]: alone}
    judging = lambda it, profile, requirement: SpecimenResult(it, fates[it.name])  # noqa: E731
    monkeypatch.setattr(schedule, "judge", judging)
    rows = schedule.judge_all([group.name], "brief", "", lambda row: None)
    bad = [it.name for it in rows if it.fate is Fate.CONDEMNED]
    assert bad == [group.members[0] if alone is Fate.CONDEMNED else group.name]


def test_of_a_group_each_is_warned_of_its_own_advice():
    group = next(it for it in groups() if it.warns)
    warned = tuple(Cell(name, "rule", "warn", "against advice") for name in group.warns)
    one = SpecimenResult(group, Fate.ALLOWED, warned)
    told = {
        it.name: {cell.requirement for cell in it.cells}
        for it in schedule.members(group, one, judge.judge, lambda row: None)
    }
    assert told == {name: VARIATIONS[name].warns for name in group.members}


def test_a_name_that_nobody_has_is_told_with_what_is_near():
    assert schedule.unknown(["releases-twice"]) == ""
    assert "did you mean releases-twice" in schedule.unknown(["releases-twice", "release-twice"])


def test_the_matrix_is_stored_for_programs_and_people(tmp_path):
    rows = [row("b", Fate.KILLED), row("a", Fate.MISTAKEN), row("v", Fate.ALLOWED, Kind.VARIATION)]
    kill_matrix.save(rows, tmp_path / "MATRIX.json")
    stored = json.loads((tmp_path / "MATRIX.json").read_text("utf-8"))
    assert [each["fate"] for each in stored["rows"]] == [each.fate for each in rows]
    page = (tmp_path / "MATRIX.md").read_text("utf-8")
    assert page == kill_matrix.markdown(rows)
    assert "| FRM-3 | `b` | breaks it | `check_it` | killed | `too-long` |" in page


OF_EACH_KIND = ["byte-order-mark", "empty-packets-are-skipped", "releases-twice", "never-closes"]


@pytest.mark.parametrize("name", OF_EACH_KIND)
def test_a_mutant_dies(name):
    judged = judge.judge(EVERY[name])
    assert judged.fate is Fate.KILLED, judged


def test_a_variation_lives():
    report, status, last_words = judge.run_harness(VARIATIONS["numbers-of-17-digits"], "CHN-10")
    assert status == 0, last_words
    assert not any(cell.condemns for cell in judge.cells_of(report))


def test_a_mutant_that_no_check_looks_at_survives():
    of_another = {"requirement": "FRM-3", "check": "check_bad_length_closes"}
    unseen = replace(MUTANTS["releases-twice"], **of_another)
    assert judge.judge(unseen).fate is Fate.SURVIVED


def test_each_specimen_is_found_by_its_name():
    for specimen in specimens()[len(REFERENCES) :]:
        assert specimen_named(specimen.name) is specimen
