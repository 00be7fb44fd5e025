"""A check on the device memory that a server announces for frames (spec 1.1 chapter 3)."""

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.server import ServerTrial

LENDS = ("1.1", "cuda", "device", "capability:cuda_ipc", "capability:frames")


@check(
    "MEM-2",
    on={SERVER: LENDS},
    cases=Cases(range(3)),
)
def check_announces_device_memory_that_is_there(trial: ServerTrial, _: int) -> bool:
    """The device of `deviceUuid`, the allocation of `handle`, which holds `bytes`, and the event of
    each slot are opened, for several readers at a time.
    """
    connection = trial.greeted("ipc")
    dealings = trial.with_(connection)
    trial.wait(lambda: dealings.memory or dealings.refusal or connection.ended)
    refusal = dealings.refusal
    if refusal and not trial.testee.expendable:
        trial.not_observable(
            f"{refusal}; of a server that the harness did not launch it is not known whether "
            "anybody here could open it"
        )
    trial.expect(not refusal, "not-openable", f"its memory cannot be opened: {refusal}")
    return dealings.memory is not None
