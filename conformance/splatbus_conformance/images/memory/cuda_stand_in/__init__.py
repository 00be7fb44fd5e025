"""A stand-in for the CUDA runtime, so that clients of device memory can be judged without a GPU."""
