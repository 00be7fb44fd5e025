from fnmatch import fnmatchcase

from tests.survivors import PAGE, families, page, sorted_into, survivors


def test_every_survivor_has_a_family_and_every_pattern_a_survivor() -> None:
    found = families()
    assert not sorted_into(found).get("")
    names = [it["name"] for it in survivors()]
    patterns = [pattern for each in found for pattern in each.patterns]
    assert all(any(fnmatchcase(name, pattern) for name in names) for pattern in patterns)


def test_the_page_is_of_what_was_judged() -> None:
    assert PAGE.read_text("utf-8") == page()
