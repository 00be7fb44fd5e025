"""The renderer's side of SplatBus."""
