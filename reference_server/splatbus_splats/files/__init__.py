"""Files that hold Gaussians, and the cameras beside them."""
