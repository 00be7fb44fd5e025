"""`images.json`: where a pixel lies, its depth, and a pixel over the client's own geometry."""

from splatbus_conformance.oracle.vectors import composites, depths, places
from splatbus_conformance.oracle.vectors.layout import Json, exactly, within


def document() -> Json:
    """Return the whole file."""
    return {
        "$schema": "vectors.schema.json",
        "name": "images",
        "version": "1.0",
        "description": "One pixel a case, of one `quantity`; every depth, alpha and colour that is"
        " given is a single-precision number. `depth`: from what a renderer gives, by `estimator`,"
        " and alpha (null: the renderer gives none) to the planar depth that a server stores, or"
        " +∞ where the pixel is empty; a server may store exactly 100.0 instead. `layers`: from"
        " planar depth and alpha of the layers along a ray, nearest first, to what a renderer"
        " accumulates, and to what each estimator makes of it. `composite`: a pixel of splats (red,"
        " green, blue, alpha; straight or premultiplied) over one of the client's own geometry."
        " `place`: from column and row, counted from the upper left, to the row in memory and the"
        " first byte of the pixel, counted from the start of the memory. `since`: what 1.0 lacks.",
        "requirements": [
            *("ACC-8", "ACC-9", "ACC-10", "BUF-1", "BUF-6", "BUF-7", "BUF-8", "BUF-9"),
            *("ACC-11", "MEM-8", "MEM-13", "MEM-14"),
        ],
        "tolerances": {
            "depth": exactly(
                "Correctly rounded to single precision, as one division does it; within 1 ULP in a"
                " kernel of a GPU (ACC-11)."
            ),
            "colour": within(
                "ulp_single", 3, "ACC-10", "ULP of single precision, at what is expected."
            ),
            "layers": within(
                "ulp_single", 1, None, "Computed in double precision; no clause gives a budget."
            ),
            "place": exactly("Whole numbers, beyond 32 bits."),
        },
        "cases": [*depths.cases(), *depths.layers(), *composites.cases(), *places.cases()],
    }
