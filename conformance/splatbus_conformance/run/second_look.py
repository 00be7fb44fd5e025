"""Whether a check that could show nothing is worth another look, at a testee started anew.

What one check leaves behind may keep another from showing anything, and that would hide what is
broken: a check counts as one that can show nothing only if a fresh testee did not help either.
"""

from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.verdicts import Result, Verdict


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

    def is_wanted(self, result: Result) -> bool:
        """Whether the check that has come to this at the first look is to be judged again. Not
        where it had a testee of its own, or none can be started.
        """
        used = self.testee.expendable and self.testee.started == self._started > 0
        return result.verdict is Verdict.SKIP and used and result.text not in self._in_vain

    def end(self, first: Result, second: Result) -> str:
        """Note what both came to; what there is to tell of it."""
        if second.verdict is Verdict.SKIP:
            self._in_vain |= {first.text, second.text}
            return ""
        return (
            f"{first.check} could show nothing of a testee that other checks had used"
            f" ({first.text}), and was judged of one started anew"
        )
