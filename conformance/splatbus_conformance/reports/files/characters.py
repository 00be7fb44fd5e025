"""Which characters of a testee's text can stand in a report."""


def printable(text: str) -> str:
    """`text` with a dot for what is no visible character, but for tabs and line feeds.

    XML forbids some of the others, UTF-8 half of a surrogate pair; marks of direction would
    rearrange what stands around them.
    """
    return "".join(c if c.isprintable() or c in "\t\n" else "·" for c in text)
