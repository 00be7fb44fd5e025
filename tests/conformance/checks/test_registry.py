"""No requirement is without a judge or a reason."""

import pytest
from splatbus_conformance.checks.registry import bound, checks_of, exclusions, judges
from splatbus_conformance.trials.testee.client_probe import ClientFacts
from splatbus_conformance.trials.testee.server_probe import ServerFacts
from splatbus_schemas.requirements import requirements

PEERS = ("client", "server")
MOST_EXCLUDED = 0.15


@pytest.mark.parametrize("peer", PEERS)
def test_every_requirement_is_judged_or_excluded(peer: str) -> None:
    neither = [r for r in bound(peer) if r not in judges(peer) and r not in exclusions(peer)]
    assert not neither


@pytest.mark.parametrize("peer", PEERS)
def test_no_requirement_is_judged_and_excluded(peer: str) -> None:
    assert not set(judges(peer)) & set(exclusions(peer))


@pytest.mark.parametrize("peer", PEERS)
def test_exclusions_name_requirements_of_that_peer_and_give_a_reason(peer: str) -> None:
    assert set(exclusions(peer)) <= set(bound(peer))
    for exclusion in exclusions(peer).values():
        assert exclusion.visible_at in ("L1", "L2", "L3", "none")
        assert len(exclusion.reason) > 40


@pytest.mark.parametrize("peer", PEERS)
def test_few_musts_are_excluded(peer: str) -> None:
    musts = {r.id for r in bound(peer).values() if r.level.startswith("MUST")}
    excluded = musts & set(exclusions(peer))
    assert len(excluded) <= MOST_EXCLUDED * len(musts), sorted(excluded)


@pytest.mark.parametrize("peer", PEERS)
def test_every_check_judges_a_requirement_on_its_side_and_says_what_it_does(peer: str) -> None:
    for check in checks_of(peer):
        assert peer in requirements("1.1")[check.requirement].binds
        assert check.does


@pytest.mark.parametrize("facts", [ClientFacts(), ServerFacts()])
def test_every_need_is_one_that_is_known(facts: ClientFacts | ServerFacts) -> None:
    side = "client" if isinstance(facts, ClientFacts) else "server"
    for need in {need for check in checks_of(side) for need in check.needs}:
        facts.lacks(need)
