"""The viewer's side of SplatBus."""
