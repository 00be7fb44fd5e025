"""Gaussian splats: files of trained scenes, and how they look.

What 3DGS and its tools write (`files`), a definition of the picture in double precision (`truth`),
and a small renderer for processors that draws it (`renderer`); see `SPLATS.md`. On top of
`splatbus_server`, by what that gives to every renderer. The core needs NumPy alone; files in PLY
and the renderer need the extra `splats`.
"""
