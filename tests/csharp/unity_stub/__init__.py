"""Stand-ins for Unity: the package in `reference_client/csharp` is compiled and run without it."""
