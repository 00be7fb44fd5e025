"""Frames on a GPU: memory that other processes open, and the kernel that fills it.

Nothing here is imported before a server asks for memory on a device; it needs cuda-bindings and
NVRTC, which the extra `cuda` brings.
"""
