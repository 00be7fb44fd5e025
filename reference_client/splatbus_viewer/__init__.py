"""What a person sees of a server: the command `splatbus-client`, pictures, meshes, figures.

On top of `splatbus_client`, by what that gives to everybody; it has no part in the protocol. The
adapter by which the harness asks what a client shows is here, too.
"""
