import hmac

from splatbus_wire.messages import ErrorMessage, Hello, Program
from splatbus_wire.negotiation import answer_hello

NAMED = Program("viewer", "2")


def test_tokens_are_compared_in_constant_time_and_told_to_nobody(monkeypatch):
    compared = []
    monkeypatch.setattr(hmac, "compare_digest", lambda a, b: compared.append((a, b)) or a == b)
    hello = Hello(("1.1",), NAMED, (), "other")
    error = answer_hello(hello, versions=("1.1",), capabilities=(), server=NAMED, token="sécret")
    assert isinstance(error, ErrorMessage)
    assert compared == [(b"other", "sécret".encode())]
    assert "sécret" not in error.message
