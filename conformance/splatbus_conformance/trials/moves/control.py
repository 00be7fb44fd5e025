"""Who has control of the scene (spec 1.1 section 6.3)."""

from splatbus_conformance.trials.moves.image_session import answers
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.sockets import Connection


def controlling(trial: ServerTrial) -> Connection:
    """A connection that has control: it was the first to pose, and was not told `busy`."""
    found = in_control(trial)
    if found is None:
        alone = trial.testee.expendable and not any(it.open for it in trial.peer.connections)
        trial.expect(not alone, "control-not-given", "the only client that there is was told busy")
        trial.not_observable("no connection is given control")
    return found


def in_control(trial: ServerTrial) -> Connection | None:
    """The same; None if none is given control in time, and every one is told `busy`."""
    found: list[Connection] = []

    def given() -> bool:
        """A server may still have to notice that whoever had control is gone."""
        first = trial.commanding()
        trial.move()
        found.append(first)
        if not answers(trial, first):
            trial.violated("no-reply", "a pose, and no more answers")
        has = busy(trial, first) == 0
        if not has:
            first.close()
        return has

    return found[-1] if trial.peer.until(given, EFFECT_SECONDS) else None


def busy(trial: ServerTrial, connection: Connection) -> int:
    """How often this connection was told `busy`."""
    return trial.with_(connection).errors().count("busy")
