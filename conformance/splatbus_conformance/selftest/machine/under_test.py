"""A pytest plugin, named by `-p`: the tests meet a changed module."""

import os

from splatbus_conformance.selftest.machine.importing import CHANGE, change_on_import

change_on_import(os.environ[CHANGE])
