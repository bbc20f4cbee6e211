"""A transfer between two checks: what test poses do to the targets before and after."""

from bpy.types import Object

from ..check.params import CheckParams
from ..check.weight_check import Fault, steps
from ..errors import Refused
from ..jobs import Jobs
from ..reporting import Report

_FAULTS = (Fault.STRETCHED, Fault.TORN, Fault.OPEN, Fault.PENETRATING)


def compared(transfer: Jobs[Report], source: Object, targets: list[Object], limit: int) -> Jobs[Report]:
    """The report of the transfer, with the faults of each target before and after in `comparison`."""
    params = CheckParams(max_influences=limit)
    before = yield from _counts(source, targets, params)
    report = yield from transfer
    after = yield from _counts(source, targets, params)
    for target in targets:
        if target.name in after:
            report.comparison[target.name] = {"before": before.get(target.name), "after": after[target.name]}
    return report


def _counts(source: Object, targets: list[Object], params: CheckParams) -> Jobs[dict[str, dict[str, int]]]:
    """Vertices by fault, of the targets that can be checked: those that an armature deforms."""
    found: dict[str, dict[str, int]] = {}
    for target in targets:
        try:
            result = yield from steps(target, source, params)
        except Refused:
            continue
        found[target.name] = {fault.name.lower(): result.counts()[fault] for fault in _FAULTS}
    return found
