"""Which characters of a testee's text can stand in a report."""


def printable(text: str) -> str:
    """`text` without the characters that XML 1.0 forbids: a testee must not break a report."""
    return "".join(
        c
        if c in "\t\n" or 32 <= ord(c) < 0xD800 or 0xE000 <= ord(c) < 0xFFFE or c > "\uffff"
        else "·"
        for c in text
    )
