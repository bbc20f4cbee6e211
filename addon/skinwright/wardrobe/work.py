"""One job of a wardrobe inside Blender: load both files, transfer, leave the weights and a record."""

import io
from pathlib import Path

import bpy
import numpy as np

from .. import native
from ..errors import sentence
from ..reporting import Report
from ..scene import armature, blend_file, loading, vertex_groups
from ..scene.error import SceneError
from ..transfer import TransferParams, from_json, transfer_weights
from .manifest import Job, ManifestError, sha256
from .results import Outcome, kept, write, write_record

# Of the files that a job may leave.
ENDINGS = (".npz", ".json", ".blend")


def run(job: Job, folder: Path, *, save_blend: bool = False) -> Outcome:
    """Do a job, unless `folder` has its result already; what goes wrong is part of the outcome, never raised."""
    try:
        inputs = job.inputs(native.addon_version())
        record = kept(folder, job, inputs)
        if record:
            return Outcome(job.name, "kept", record)
        record = _work(job, folder, save_blend) | {"inputs": inputs}
        write_record(folder, job, record)
    except ManifestError as error:
        return Outcome(job.name, "failed", {"error": str(error)})
    except Exception as error:  # one bad garment of a thousand stops none of the others
        return Outcome(job.name, "failed", {"error": sentence(job.name, error)})
    return Outcome(job.name, "done", record)


def _work(job: Job, folder: Path, save_blend: bool) -> dict:
    params = _params(job)
    loading.empty()
    bodies = loading.load(job.body)
    source = _body(job, bodies)
    with loading.names_set_free(bodies):
        targets = _garments(job, loading.load(job.garment))
    depends = {str(path): sha256(path) for path in loading.depends(job.body, job.garment)}
    report = transfer_weights(bpy.context, source, targets, params)
    written = {f"{job.name}.npz": write(folder, f"{job.name}.npz", _weights(targets))}
    if save_blend:
        path = folder / f"{job.name}.blend"
        blend_file.save_copy(path)
        written[path.name] = sha256(path)
    said = {"sentence": report.sentence(), "warnings": report.all_warnings()}
    return {"files": written, "depends": depends} | said | _scores(report)


def _params(job: Job) -> TransferParams:
    try:
        return from_json(job.settings)
    except ValueError as error:
        raise SceneError(f"settings of {job.name}: {error}") from error


def _body(job: Job, loaded: list[bpy.types.Object]) -> bpy.types.Object:
    meshes = [obj for obj in loaded if obj.type == "MESH"]
    if job.body_object:
        chosen = [obj for obj in meshes if obj.name == job.body_object]
    else:
        chosen = [obj for obj in meshes if armature.find(obj)]
    if len(chosen) != 1:
        wanted = f"the mesh {job.body_object}" if job.body_object else "exactly one mesh with an armature"
        names = ", ".join(obj.name for obj in meshes) or "none"
        raise SceneError(f"{job.body.name} should hold {wanted}; its meshes are {names}: name one as object")
    return chosen[0]


def _garments(job: Job, loaded: list[bpy.types.Object]) -> list[bpy.types.Object]:
    meshes = {obj.name: obj for obj in loaded if obj.type == "MESH"}
    missing = [name for name in job.objects if name not in meshes]
    if missing or not meshes:
        names = ", ".join(meshes) or "none"
        raise SceneError(f"{job.garment.name} lacks {', '.join(missing) or 'a mesh'}; its meshes are {names}")
    return [meshes[name] for name in job.objects or meshes]


def _weights(targets: list[bpy.types.Object]) -> bytes:
    """An .npz archive: per object its group names and the rows over them (CSR)."""
    arrays: dict[str, np.ndarray] = {"objects": np.array([target.name for target in targets])}
    for number, target in enumerate(targets):
        names = sorted(group.name for group in target.vertex_groups)
        rows = vertex_groups.read(target, names)
        arrays |= {f"{number}.groups": np.array(names, dtype=str), f"{number}.indptr": rows.indptr}
        arrays |= {f"{number}.bones": rows.bones, f"{number}.values": rows.values}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _scores(report: Report) -> dict:
    """What a supervisor sorts by."""
    vertices = sum(garment.vertices for garment in report.garments)
    matched = sum(garment.matched for garment in report.garments)
    inpainted = sum(garment.inpainted for garment in report.garments)
    share = 1 - matched / vertices if vertices else 1.0
    return {"vertices": vertices, "matched": matched, "inpainted": inpainted, "unmatched_share": round(share, 6)}
