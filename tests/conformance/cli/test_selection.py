"""What `--select` and `--deselect` leave of a run."""

import pytest
from splatbus_conformance.cli.arguments import parse_selection
from splatbus_conformance.plan import SIDES, Side
from splatbus_conformance.run.options import selectable_on
from splatbus_conformance.selection import PROFILES, RULE, Item, Selection, UnknownTermError, terms

CHECK = Item("FRM-3", "check_bad_length", "L1")
SLOW = Item("FRM-5", "check_incomplete", "L1", "full")
RULES = Item("FRM-3", RULE, "L0")
OTHER = Item("JSN-6", "check_spelling", "L2")
ITEMS = (CHECK, SLOW, RULES, OTHER)


@pytest.mark.parametrize(
    ("only", "never", "profile", "left"),
    [
        ("", "", "quick", [CHECK, RULES, OTHER]),
        ("FRM-3", "", "quick", [CHECK, RULES]),
        ("frm", "", "quick", [CHECK, RULES]),
        ("L0", "", "quick", [RULES]),
        ("l2,check_bad_length", "", "quick", [CHECK, OTHER]),
        ("", "FRM", "quick", [OTHER]),
        ("", "L0, JSN-6", "quick", [CHECK]),
        ("FRM-3", "L0", "quick", [CHECK]),
        ("FRM-3", "FRM-3", "quick", []),
        (" , ", "", "quick", [CHECK, RULES, OTHER]),
        ("FRM-5", "", "quick", [SLOW]),
        ("check_incomplete", "", "quick", [SLOW]),
        ("FRM", "", "full", [CHECK, SLOW, RULES]),
        ("", "", "soak", list(ITEMS)),
    ],
)
def test_terms_name_ids_clauses_levels_and_checks(
    only: str, never: str, profile: str, left: list[Item]
) -> None:
    selection = Selection(terms(only, ITEMS, {}), terms(never, ITEMS, {}))
    assert [item for item in ITEMS if selection.takes(item, profile)] == left


def test_each_profile_runs_what_a_shorter_one_does() -> None:
    waits = Item("CHN-15", "check_waits", "L1", "quick")
    assert [it for it in PROFILES if Selection().takes(waits, it)] == ["quick", "full", "soak"]


@pytest.mark.parametrize("term", ["FRM-4", "L9", "check_bad_lenght", "rule"])
def test_a_term_that_means_nothing_is_told_what_there_is(term: str) -> None:
    with pytest.raises(UnknownTermError) as caught:
        terms(f"FRM,{term}", ITEMS, {})
    text = str(caught.value)
    assert text.startswith(term)
    assert ("did you mean check_bad_length" in text) == term.startswith("check")
    assert "clauses are FRM, JSN, levels L0, L1, L2, L3" in text


def test_what_the_other_side_sends_wrong_is_selected_by_what_this_side_does_about_it() -> None:
    assert parse_selection("ini-4", "", "client").only == ("INI-8", "INI-9")
    assert "INI-9" in parse_selection("INI", "INI-4", "client").never


@pytest.mark.parametrize("side", SIDES)
def test_no_two_checks_of_a_side_have_one_name(side: Side) -> None:
    names = [item.name for item in selectable_on(side) if item.name != RULE]
    assert len(names) == len(set(names))
