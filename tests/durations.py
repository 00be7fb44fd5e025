"""How long things took before, for whoever shares them out; each run renews what it ran.

Those of checks are data of the harness; the others are in `tests/data/durations.json`.
"""

import json
import statistics
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OURS = ROOT / "tests" / "data" / "durations.json"
HARNESS = ROOT / "conformance" / "splatbus_conformance" / "data" / "durations.json"
UNKNOWN_SECONDS = 1000.0
"""What nobody has measured comes first."""
OTHERWISE = 2.0
"""By which factor something has to take longer or shorter, on a machine of the same speed, to be
stored anew: else each run would change the file."""


class Durations:
    """Those of one kind."""

    def __init__(self, kind: str, file: Path = OURS, shortest: float = 1.0) -> None:
        """`shortest` is stored of what takes less: it fills the gaps in any order."""
        self._kind, self._file, self._short = kind, file, shortest
        self._known: dict[str, float] = self._read().get(kind, {})
        self._measured: dict[str, float] = {}

    def of(self, name: str) -> float:
        """The seconds that it took."""
        return self._known.get(name, UNKNOWN_SECONDS)

    def expected(self, names: Iterable[str]) -> dict[str, float]:
        """What they took; of what nobody has measured, what others took on average."""
        usual = statistics.mean(self._known.values()) if self._known else UNKNOWN_SECONDS
        return {name: self._known.get(name, usual) for name in names}

    def unknown(self, names: Iterable[str]) -> list[str]:
        """Those of which nothing is known."""
        return [name for name in names if name not in self._known]

    def took(self, name: str, seconds: float) -> None:
        """What it took now; the longest counts."""
        self._measured[name] = max(seconds, self._short, self._measured.get(name, 0.0))

    def save(self, *, gone: bool = False) -> None:
        """Store what is new or was otherwise; and, where all were run, forget what is `gone`."""
        both = [name for name in self._measured if name in self._known]
        ratios = [self._measured[name] / self._known[name] for name in both]
        speed = statistics.median(ratios) if ratios else 1.0
        renewed = {} if gone else dict(self._known)
        for name, seconds in self._measured.items():
            now, before = seconds / speed, self._known.get(name)
            same = before is not None and before / OTHERWISE < now < before * OTHERWISE
            renewed[name] = before if same else round(max(now, self._short), 1)  # type: ignore[assignment]
        if renewed != self._known:
            self._known = renewed
            self._file.write_text(as_text({**self._read(), self._kind: renewed}), "utf-8")

    def _read(self) -> dict[str, dict[str, float]]:
        found: dict[str, dict[str, float]] = (
            json.loads(self._file.read_text("utf-8")) if self._file.is_file() else {}
        )
        return found


def as_text(stored: dict[str, dict[str, float]]) -> str:
    """As it is stored: by name, so that a change is a line."""
    return json.dumps(stored, indent=1, sort_keys=True) + "\n"
