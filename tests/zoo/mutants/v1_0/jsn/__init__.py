"""Text: JSN (spec 1.0 chapter 2)."""
