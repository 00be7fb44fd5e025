"""Change what the client, or the server, asks of the CUDA driver."""

from splatbus_client.cuda import images, legacy, opened
from splatbus_server.cuda import driver

from tests.zoo.faults import device
from tests.zoo.faults.seam import Seam


def calls(patch, *names, around):
    """Put `around` before every call of these functions; it is given what calls first, then the
    function and its arguments.
    """

    def call(original, function, *arguments):
        if function.__name__ in names:
            return around(original, function, *arguments)
        return original(function, *arguments)

    for module in (images, legacy, opened, driver, device):
        Seam(module, "call").wrap(patch, call)


def without(patch, *names):
    """Never call these functions."""
    calls(patch, *names, around=lambda *_: None)
