"""`splatbus-client window`: look at a server's images through a window, and steer by hand."""
