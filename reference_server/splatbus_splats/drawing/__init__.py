"""How Gaussians look: the definition, its truth in float64, and two renderers of it.

`processor` needs the extra `splats` (Numba), `gpu` gsplat; the others NumPy alone.
"""
