"""What draws an image with OpenGL: no window and no interface, only a context of moderngl."""
