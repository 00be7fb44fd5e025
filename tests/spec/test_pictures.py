"""The axes are drawn as the table of chapter 7 has them."""

from xml.etree import ElementTree

import pytest
from splatbus_schemas import pictures
from splatbus_schemas.prose import CHECKOUT

FRAMES = pictures.frames((CHECKOUT / "spec" / pictures.TABLE).read_text("utf-8"))
SVG = "{http://www.w3.org/2000/svg}"
PICTURE = ElementTree.parse(CHECKOUT / "spec" / pictures.PLACE).getroot()
CARDS = [g for g in PICTURE.iter(f"{SVG}g") if g.get("class") is None]


@pytest.mark.parametrize("frame", FRAMES, ids=lambda frame: frame.name)
def test_the_handedness_is_that_of_the_axes(frame: pictures.Frame) -> None:
    assert frame.handedness == ("right" if frame.is_right_handed else "left")


@pytest.mark.parametrize(("frame", "card"), list(zip(FRAMES, CARDS, strict=True)))
def test_each_axis_leads_where_its_name_says(
    frame: pictures.Frame, card: ElementTree.Element
) -> None:
    name, caption = card.findall(f"{SVG}text")
    assert name.text == frame.name
    assert caption.text == f"{frame.handedness}-handed, {frame.unit}"
    leads = {"right": (1, 0), "up": (0, -1), "down": (0, 1), "forward": (1, -1)}
    for axis, letter in zip(card.findall(f"{SVG}g"), "xyz", strict=True):
        text, line = axis.find(f"{SVG}text"), axis.find(f"{SVG}line")
        assert text is not None
        assert line is not None
        word, direction = (text.text or "").split()
        assert (word, direction) == (letter, frame.axes["xyz".index(letter)])
        x1, y1, x2, y2 = (float(line.get(end, "")) for end in ("x1", "y1", "x2", "y2"))
        signs = tuple((a > b) - (a < b) for a, b in ((x2, x1), (y2, y1)))
        assert signs == leads.get(direction, (-1, 1))
