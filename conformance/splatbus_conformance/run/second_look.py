"""Whether a check is worth another look.

What one check leaves behind may keep another from showing anything, and that would hide what is
broken: a check counts as one that can show nothing only if a testee started anew did not help
either. And where a busy machine kept the testee from running, or the harness from answering it, a
testee that gave up did as it should: that is held against it only if it is seen again.
"""

from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.verdicts import BROKEN, Result, Verdict

KEPT_SECONDS = 1.0
"""Half of the shortest time after which a testee was seen to give up."""


class SecondLook:
    """The looks that are taken at one testee."""

    def __init__(self, testee: Testee) -> None:
        self.testee = testee
        self._started = 0.0
        self._in_vain: set[str] = set()
        """The reasons that a fresh testee did not take away: the next would not, either."""

    def begin(self) -> None:
        """A check begins."""
        self._started = self.testee.started

    def is_wanted(self, result: Result, kept_seconds: float) -> bool:
        """Whether the check that has come to this at the first look is to be judged again, after a
        machine has kept it waiting for so long. Not where no testee can be started, nor where one
        that could show nothing was fresh.
        """
        if not self.testee.expendable or not self.testee.started:
            return False
        if result.verdict in BROKEN:
            return kept_seconds >= KEPT_SECONDS
        used = self.testee.started == self._started
        return result.verdict is Verdict.SKIP and used and result.text not in self._in_vain

    def end(self, first: Result, second: Result) -> str:
        """Note what both came to; what there is to tell of it."""
        if first.verdict in BROKEN and second.verdict in BROKEN:
            return ""
        if first.verdict in BROKEN:
            return (
                f"{first.check} has shown what a second look did not, while the machine kept it"
                f" waiting: {first.text}"
            )
        if second.verdict is Verdict.SKIP:
            self._in_vain |= {first.text, second.text}
            return ""
        return (
            f"{first.check} could show nothing of a testee that other checks had used"
            f" ({first.text}), and was judged of one started anew"
        )
