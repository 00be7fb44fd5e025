"""What `--select` and `--deselect` leave of a run."""

import pytest
from splatbus_conformance.cli.arguments import parse_selection
from splatbus_conformance.plan import SIDES
from splatbus_conformance.run.options import selectable_on
from splatbus_conformance.selection import PROFILES, RULE, Item, Selection, UnknownTermError, terms

CHECK = Item("FRM-3", "check_bad_length", "L1")
SLOW = Item("FRM-5", "check_incomplete", "L1", "full")
RULES = Item("FRM-3", RULE, "L0")
OTHER = Item("JSN-6", "check_spelling", "L2")
ITEMS = (CHECK, SLOW, RULES, OTHER)


def chosen(only: str = "", never: str = "", profile: str = "quick") -> list[Item]:
    selection = Selection(terms(only, ITEMS, {}), terms(never, ITEMS, {}))
    return [item for item in ITEMS if selection.takes(item, profile)]


@pytest.mark.parametrize(
    ("only", "never", "left"),
    [
        ("", "", [CHECK, RULES, OTHER]),
        ("FRM-3", "", [CHECK, RULES]),
        ("frm", "", [CHECK, RULES]),
        ("L0", "", [RULES]),
        ("l2,check_bad_length", "", [CHECK, OTHER]),
        ("", "FRM", [OTHER]),
        ("", "L0, JSN-6", [CHECK]),
        ("FRM-3", "L0", [CHECK]),
        ("FRM-3", "FRM-3", []),
        (" , ", "", [CHECK, RULES, OTHER]),
    ],
)
def test_terms_name_ids_clauses_levels_and_checks(only: str, never: str, left: list[Item]) -> None:
    assert chosen(only, never) == left


def test_what_is_named_itself_runs_in_any_profile_but_a_clause_does_not_name() -> None:
    assert chosen("FRM-5") == chosen("check_incomplete") == [SLOW]
    assert SLOW not in chosen("FRM")
    assert SLOW in chosen("FRM", profile="full")
    assert SLOW in chosen(profile="soak")


def test_each_profile_runs_what_a_shorter_one_does() -> None:
    waits = Item("CHN-15", "check_waits", "L1", "quick")
    taken = [it for it in PROFILES if Selection().takes(waits, it)]
    assert taken == ["quick", "full", "soak"]


@pytest.mark.parametrize("term", ["FRM-4", "L9", "check_bad_lengths", "rule"])
def test_a_term_that_means_nothing_is_told_what_there_is(term: str) -> None:
    with pytest.raises(UnknownTermError) as caught:
        terms(f"FRM,{term}", ITEMS, {})
    text = str(caught.value)
    assert text.startswith(term)
    assert "FRM, JSN" in text
    assert "L0, L1, L2, L3" in text


def test_what_the_other_side_sends_wrong_is_selected_by_what_this_side_does_about_it() -> None:
    assert parse_selection("ini-4", "", "client").only == ("INI-8", "INI-9")
    assert "INI-9" in parse_selection("INI", "INI-4", "client").never


def test_a_near_miss_is_asked_about() -> None:
    with pytest.raises(UnknownTermError, match="did you mean check_bad_length"):
        terms("check_bad_lenght", ITEMS, {})


@pytest.mark.parametrize("side", SIDES)
def test_no_two_checks_of_a_side_have_one_name(side: str) -> None:
    names = [item.name for item in selectable_on(side) if item.name != RULE]
    assert len(names) == len(set(names))
