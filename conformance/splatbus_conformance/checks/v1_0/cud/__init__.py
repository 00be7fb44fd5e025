"""Memory and events of CUDA: CUD (spec 1.0 chapter 4)."""
