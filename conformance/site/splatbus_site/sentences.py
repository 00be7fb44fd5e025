"""What Sphinx does with requirements: each is an anchor, and each mention of one a link.

Requirements keep their ids as they are written, `#FRM-3`, which docutils would not: it wants small
letters. So the nodes are made here, not by directives, and the prose stays plain Markdown.
"""

import re
from collections.abc import Iterator

from docutils import nodes  # type: ignore[import-untyped]
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.transforms.post_transforms import SphinxPostTransform
from splatbus_schemas import VERSIONS, requirements

from .judged import CHECKS, COVERAGE, check_names
from .layout import docname

_ID = re.compile(r"\[([A-Z]{3}-\d+)\]")
_MENTION = re.compile(r"(?<![\w-])([A-Z]{3}-\d+)(?![\w-])")
_UNTOUCHED = (nodes.title, nodes.reference, nodes.literal_block, nodes.raw, nodes.comment)
_KNOWN = requirements(VERSIONS[-1])


class AnchorRequirements(SphinxTransform):
    """Puts each requirement and what belongs to it into a box that has its id."""

    default_priority = 500

    def apply(self) -> None:
        """Go through what is printed bold: ids are."""
        for strong in list(self.document.findall(nodes.strong)):
            if (name := _defined_by(strong)) is not None:
                self._enclose(strong, name)

    def _enclose(self, strong: nodes.strong, name: str) -> None:
        paragraph = strong.parent
        badge = nodes.reference(
            "", name, refuri=f"#{name}", internal=True, classes=["requirement-id"]
        )
        badge["reftitle"] = f"Link to {name}"
        paragraph.replace(strong, badge)
        parent, place = paragraph.parent, paragraph.parent.index(paragraph)
        box = nodes.container("", ids=[name], classes=["requirement"])
        following = parent[place + 1] if place + 1 < len(parent) else None
        parent.remove(paragraph)
        box += paragraph
        if isinstance(following, nodes.block_quote) and not _ID.match(following.astext()):
            parent.remove(following)
            box += _facts(following)
        if self.env.docname == docname(_KNOWN[name].chapter):
            box.insert(0, addnodes.index(entries=[("single", name, name, "", None)]))
        parent.insert(place, box)


class LinkMentions(SphinxPostTransform):
    """Makes each requirement and each check that is mentioned a link to where it stands."""

    default_priority = 800

    def run(self, **_: object) -> None:
        """Go through all text but headings, links and blocks of code."""
        boxes = (box for box in self.document.findall(nodes.container) if box["ids"])
        self._here = {name for box in boxes for name in box["ids"]}
        for text in list(self.document.findall(nodes.Text)):
            if not any(isinstance(each, _UNTOUCHED) for each in _ancestors(text)):
                self._link(text)

    def _link(self, text: nodes.Text) -> None:
        literal = text.parent
        if isinstance(literal, nodes.literal):
            if (uri := self._uri(str(text))) is not None:
                link = nodes.reference("", "", refuri=uri, internal=True)
                literal.parent.replace(literal, link)
                link += literal
            return
        pieces = [
            piece for each in _MENTION.split(str(text)) if each for piece in self._pieces(each)
        ]
        if any(isinstance(piece, nodes.reference) for piece in pieces):
            text.parent.replace(text, pieces)

    def _pieces(self, text: str) -> Iterator[nodes.Node]:
        uri = self._uri(text) if text in _KNOWN else None
        if uri is None:
            yield nodes.Text(text)
        else:
            yield nodes.reference("", text, refuri=uri, internal=True, classes=["mention"])

    def _uri(self, name: str) -> str | None:
        """Where a requirement or a check stands, seen from this page."""
        if name in self._here:
            return f"#{name}"
        if name in _KNOWN:
            there = docname(_KNOWN[name].chapter)
        elif name in check_names():
            there = docname(CHECKS)
        else:
            return None
        return f"{self.app.builder.get_relative_uri(self.env.docname, there)}#{name}"


class LinkCoverage(SphinxPostTransform):
    """Adds to each requirement a link to what judges it."""

    default_priority = 801

    def run(self, **_: object) -> None:
        """Go through the boxes that are there by now."""
        coverage = self.app.builder.get_relative_uri(self.env.docname, docname(COVERAGE))
        for box in self.document.findall(nodes.container):
            if "requirement" in box["classes"]:
                (name,) = box["ids"]
                facts = box[-1][0] if len(box) > 1 else box[0]
                facts += nodes.Text(" ")
                facts += nodes.reference(
                    "",
                    "What judges it",
                    refuri=f"{coverage}#coverage-{name}",
                    internal=True,
                    classes=["judged-by"],
                )


def setup(app: Sphinx) -> dict[str, bool]:
    """Let Sphinx apply these to every page."""
    app.add_transform(AnchorRequirements)
    app.add_post_transform(LinkMentions)
    app.add_post_transform(LinkCoverage)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _defined_by(strong: nodes.strong) -> str | None:
    """The id of the requirement that begins here, if one does; one that is quoted does not."""
    match = _ID.fullmatch(strong.astext())
    begins = isinstance(strong.parent, nodes.paragraph) and not any(
        each.astext() for each in strong.parent.children[: strong.parent.index(strong)]
    )
    stands_alone = begins and isinstance(strong.parent.parent, nodes.section)
    return match[1] if match and stands_alone else None


def _facts(quote: nodes.block_quote) -> nodes.container:
    """What stands below a sentence, each line of it a paragraph: whom it binds, and why."""
    facts = nodes.container("", classes=["requirement-facts"])
    for paragraph in quote.children:
        line = nodes.paragraph()
        for child in list(paragraph.children):
            if isinstance(child, nodes.Text) and child == "\n":
                facts += line
                line = nodes.paragraph()
            else:
                line += child
        facts += line
    return facts


def _ancestors(node: nodes.Node) -> Iterator[nodes.Node]:
    while node.parent is not None:
        node = node.parent
        yield node
