"""Gaussian splats: files of trained scenes, and how they look.

What 3DGS and its tools write (`files`), a definition of the picture in double precision (`truth`),
and a small renderer for processors that draws it (`renderer`); see `SPLATS.md`. On top of
`splatbus_server`, by what that gives to every renderer; the command `splatbus-server` is here, and
without files serves what `splatbus_renderer` draws. Only the renderer needs the extra `splats`.
"""
