"""The one place where a transfer changes the scene."""

import time

import bpy
import numpy as np

from .. import csr
from ..csr import Rows
from ..reporting import GarmentReport
from ..scene import armature, mesh, vertex_groups
from .checks import garment_warnings
from .compute import Result
from .inputs import Body, Garment
from .params import TransferParams


def write(body: Body, garment: Garment, result: Result, params: TransferParams) -> GarmentReport:
    """Write the rows, and what they need to act: missing groups, their mirror partners, the armature."""
    start = time.perf_counter()
    target = garment.object
    warnings = garment_warnings(body, garment, params)
    if params.make_single_user and mesh.other_users(target):
        target.data = target.data.copy()
    before = {group.name for group in target.vertex_groups}
    vertices = np.flatnonzero(result.written)
    names, rows = _needed_columns(result, csr.take_rows(result.rows, vertices), before)
    vertex_groups.write(target, names, rows, vertices)
    vertex_groups.ensure(target, _mirror_partners(names, body.bones))
    attached = params.add_armature and body.armature is not None and armature.find(target) is None
    if attached:
        armature.attach(target, body.armature)
    seconds = {"read": garment.seconds, "compute": result.seconds, "write": time.perf_counter() - start}
    return _report(garment, result, names, before, attached, seconds, warnings)


def _needed_columns(result: Result, rows: Rows, present: set[str]) -> tuple[list[str], Rows]:
    """Without the groups that would be created to stay empty."""
    used = np.bincount(rows.bones, minlength=len(result.names)) > 0
    needed = used | np.array([name in present for name in result.names], bool)
    return [name for name, kept in zip(result.names, needed, strict=True) if kept], csr.take_columns(rows, needed)


def _mirror_partners(names: list[str], bones: list[str]) -> list[str]:
    """The other side's names, for mirroring tools and the Mirror modifier find nothing without the group."""
    return sorted({bpy.utils.flip_name(name) for name in names} & set(bones))


def _report(
    garment: Garment,
    result: Result,
    names: list[str],
    before: set[str],
    attached: bool,
    seconds: dict[str, float],
    warnings: list[str],
) -> GarmentReport:
    now = [group.name for group in garment.object.vertex_groups]
    matched = result.transfer.matched & result.written
    return GarmentReport(
        target=garment.object.name,
        vertices=len(result.written),
        matched=int(matched.sum()),
        inpainted=int((result.written & ~matched).sum()),
        untouched=int((~result.written).sum()),
        groups=len(names),
        created_groups=[name for name in now if name not in before],
        locked_groups=sorted(garment.locks),
        kept_groups=sorted(before - set(names) - garment.locks),
        armature_added=attached,
        seconds=seconds,
        native=dict(result.transfer.report),
        warnings=warnings,
    )
