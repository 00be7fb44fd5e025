"""The reference pair in a world of virtual time, drawn from one seed.

The server's `Service` and the client's `Channel` run as they are, on sockets, selectors, clocks and
memory that stand in for the system's (`machine`). A session is some seconds in which everything
goes wrong that may, and then a calm in which everyone has to be served. After each step the
invariants are looked at; what breaks one is replayed by its seed:

    python -m tests.simulation --seed 123 -v
"""
