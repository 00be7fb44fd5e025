"""SplatBus in Blender.

`core` knows nothing of Blender, `reading` and `viewing` take its things and do not import it;
`service` and what stands on it do. Importing this imports none of them, so that what needs no
Blender can be tried without it.
"""
