"""`python -m tests.size`: how large each part is, in tokens of Python, and how large it may be.

Tokens are `tokenize`'s, but for comments, line ends and indentation: ideas are counted, not how
they are laid out. Whoever lands less lowers the ceiling to what is left. None is raised, but for
what a new sentence of the standard brings, and for what goes wrong at a user's desk.
"""

import subprocess
import sys
import tokenize
from collections import Counter
from pathlib import Path

from splatbus_schemas.requirements import requirements

ROOT = Path(__file__).resolve().parents[1]
CEILINGS = {
    "conformance": 305_140,
    "tests": 424_830,
    "schemas": 38_500,
    "reference_server": 69_450,
    "reference_client": 55_920,
    "benchmarks": 32_700,
}
SENTENCES = 283
"""Of the standard, when these were the ceilings."""
PER_SENTENCE = dict.fromkeys(CEILINGS, 50) | {"conformance": 200, "tests": 150, "benchmarks": 0}
"""What each that is new since may bring to a part."""
F_STRING = ("FSTRING_START", "FSTRING_END")
"""Between which Python 3.12 and later see what is one token before."""
LAYOUT = frozenset(
    {
        *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
        *(tokenize.ENCODING, tokenize.ENDMARKER),
    }
)


def sizes() -> Counter[str]:
    """The tokens of each part, of the files that git knows or may come to know."""
    listed = ("git", "ls-files", "--cached", "--others", "--exclude-standard", "*.py")
    names = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    found: Counter[str] = Counter()
    for name in names.splitlines():
        path = ROOT / name
        if path.is_file() and not path.is_symlink():
            found[name.partition("/")[0]] += tokens(path)
    return found


def tokens(path: Path) -> int:
    """Those of a file. Raises OSError, SyntaxError and tokenize.TokenError."""
    found = within = 0
    with path.open("rb") as file:
        for it in tokenize.tokenize(file.readline):
            begins, ends = (it.type == getattr(tokenize, name, None) for name in F_STRING)
            found += it.type not in LAYOUT and not within
            within += begins - ends
    return found


def main() -> int:
    """Print the table; 1 if something is larger than it may be."""
    found = sizes()
    new = len(requirements("1.1")) - SENTENCES
    most_of = {part: most + new * PER_SENTENCE[part] for part, most in CEILINGS.items()}
    rows = [(part, found[part], most) for part, most in most_of.items()]
    rows.append(("all", found.total(), sum(most_of.values())))
    for part, size, most in rows:
        over = f"  {size - most:,} too many" if size > most else ""
        print(f"{part:<18}{size:>11,} of {most:>11,}{over}")
    return any(size > most for _, size, most in rows)


if __name__ == "__main__":
    sys.exit(main())
