"""What a run has found out: verdicts and counts."""

from dataclasses import dataclass, field, replace

from splatbus_schemas.requirements import Requirement, requirements

from splatbus_conformance.plan import Plan
from splatbus_conformance.reports import latencies
from splatbus_conformance.reports.latencies import Latencies
from splatbus_conformance.rules import Breach, tally
from splatbus_conformance.rules.tally import Tally
from splatbus_conformance.selection import RULE, Item
from splatbus_conformance.verdicts import BROKEN, Result, Verdict, worst


@dataclass
class Traffic:
    """What crossed the wire, in numbers, and what it took."""

    testee: str = ""
    version: str = "1.0"
    """Of the specification, by which the testee is judged."""
    device: str = ""
    """Where device memory lay, if there was a device."""
    delivered: int = 0
    """Cases delivered and followed by something that proves it."""
    left_out: int = 0
    """Listed cases that were left for another seed, or for the full profile."""
    busy_seconds: float = 0.0
    """CPU time of the harness."""
    waiting_seconds: float = 0.0
    """Time in which the harness waited for the testee, or listened to its silence."""
    tally: Tally = field(default_factory=dict)
    latencies: Latencies = field(default_factory=dict)
    """How long the testee took for its answers."""
    advice: list[str] = field(default_factory=list)
    """What the meeting with the testee suggests to its author."""
    losses: list[Result] = field(default_factory=list)
    """Vital signs that the testee lost, charged to the check that took them."""
    ended: str = ""
    """How the testee ended by itself, when it last did."""
    printed: str = ""
    """The last that it had printed then."""
    scripts: dict[str, str] = field(default_factory=dict)
    """What was delivered where a rule first saw a requirement broken, by that requirement."""
    late_seconds: float = 0.0
    """By how much the harness came too late to look, at worst."""

    def add(self, other: "Traffic") -> None:
        """Count what happened elsewhere as well."""
        self.testee = self.testee or other.testee
        self.version = max(self.version, other.version)
        self.device = self.device or other.device
        self.delivered += other.delivered
        self.left_out += other.left_out
        self.busy_seconds += other.busy_seconds
        self.waiting_seconds += other.waiting_seconds
        self.late_seconds = max(self.late_seconds, other.late_seconds)
        tally.add(self.tally, other.tally)
        latencies.add(self.latencies, other.latencies)
        self.advice = list(dict.fromkeys([*self.advice, *other.advice]))
        self.losses += other.losses
        if other.ended:
            self.ended, self.printed = other.ended, other.printed
        self.scripts = other.scripts | self.scripts

    def sentence(self, seconds: float) -> str:
        """What was done, in how long, and how much of that the harness took."""
        text = f"{self.delivered:,} cases delivered in {seconds:.1f} s"
        if self.delivered:
            text += (
                f"; each took {1000 * self.busy_seconds / self.delivered:.2f} ms of the harness"
                f" and {1000 * self.waiting_seconds / self.delivered:.2f} ms of waiting"
            )
        if self.left_out:
            text += f"; {self.left_out:,} cases were left out; --profile full delivers more"
        if self.device:
            text += f"; device memory: {self.device}"
        return text

    def judged(self, side: str) -> dict[str, Requirement]:
        """What the testee could be judged by: of 1.1 only where it is claimed."""
        return {id: r for id, r in requirements(self.version).items() if side in r.binds}


@dataclass
class Findings:
    """All that came of a run."""

    traffic: Traffic = field(default_factory=Traffic)
    placed: dict[int, Result] = field(default_factory=dict)
    """What each check said, by its place in a serial run."""
    seeds: list[int] = field(default_factory=list)
    """Of the runs that were added up."""
    cut: str = ""
    """Why the run ended before all checks had run."""
    left: int = 0
    """Checks that did not run for that."""

    def put(self, place: int, result: Result) -> None:
        """Note a verdict; of two on one place, which different seeds gave, the worse."""
        other = self.placed.get(place)
        if other is None or worst([result, other]) is not other.verdict:
            self.placed[place] = result

    def add(self, other: "Findings", seed: int) -> None:
        """Take in what a run with this seed found; each failure says which seed it was."""
        self.seeds.append(seed)
        self.cut, self.left = other.cut, other.left
        for place, result in other.placed.items():
            told = replace(result, text=f"{result.text} (seed {seed})")
            self.put(place, told if result.verdict in BROKEN else result)
        counts = other.traffic.tally
        for name, count in counts.items():
            if count.broken:
                counts[name] = count._replace(first=_of_seed(count.first, seed))
        self.traffic.add(other.traffic)

    def results(self, plan: Plan) -> list[Result]:
        """Every verdict, in the order of a serial run; the rules have the last word."""
        judged = self.traffic.judged(plan.side)
        losses = self.traffic.losses
        harmful = {loss.check: loss for loss in losses}
        found = [
            _unproven(self.placed[place], harmful.get(self.placed[place].check))
            for place in sorted(self.placed)
        ]
        return [*found, *losses] + [
            replace(
                tally.result(name, self.traffic.tally[name], requirement.level),
                script=self.traffic.scripts.get(name, ""),
            )
            for name, requirement in judged.items()
            if name in self.traffic.tally and plan.selection.takes(Item(name, RULE, "L0"))
        ]


def _unproven(result: Result, loss: Result | None) -> Result:
    """A pass is none if the testee was not sound afterwards."""
    if loss is None or result.verdict is not Verdict.PASS:
        return result
    return replace(result, verdict=Verdict.SKIP, text=f"{loss.text} ({loss.requirement})")


def _of_seed(breach: Breach | None, seed: int) -> Breach | None:
    return breach and breach._replace(words=f"{breach.words} (seed {seed})")
