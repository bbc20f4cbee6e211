"""Work without a window: `blender -c skinwright COMMAND ...`, and the scripts of the same names.

Exit codes: 0 done, 1 failed (the sentence is on stderr), 2 wrong usage.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import bpy

from .. import autoskin, declared, embed, files, native
from ..declared import SettingError
from ..errors import Refused, internal
from ..reporting import AutoskinReport, Report, SculptReport
from ..retarget import RetargetParams, RetargetReport, retarget_weights
from ..retarget import from_json as retarget_from_json
from ..retarget import to_json as retarget_to_json
from ..scene import blend_file
from ..scene.blend_file import mesh_named, object_named
from ..sculpt.params import SculptParams, options_from_json
from ..sculpt.replay import read, replay
from ..transfer import TransferParams, from_json, transfer_weights
from . import refine as refine_command
from . import wardrobe as wardrobe_command
from . import weights as weights_command

DONE, FAILED, USAGE = 0, 1, 2
Params = TransferParams | SculptParams | RetargetParams | autoskin.AutoskinParams | embed.EmbedParams
AnyReport = Report | SculptReport | RetargetReport | AutoskinReport | embed.EmbedReport


class _Failure(Refused):
    """A sentence for stderr, with exit code 1."""


def main(arguments: list[str]) -> int:
    """`skinwright transfer ...`, `skinwright sculpt ...` or `skinwright --version`; gives the exit code."""
    parser = argparse.ArgumentParser(prog="skinwright", description="Skin weights without a window.")
    parser.add_argument("--version", action="version", version=f"Skinwright {native.addon_version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    _add_transfer(commands.add_parser("transfer", help="transfer weights from a body to garments"))
    _add_sculpt(commands.add_parser("sculpt", help="turn recorded sculpts of a posed mesh into weights"))
    _add_retarget(commands.add_parser("retarget", help="take the weights of another character"))
    _add_autoskin(commands.add_parser("autoskin", help="compute weights for the bones of an armature from scratch"))
    _add_embed(commands.add_parser("embed", help="put the armature of another character into meshes that have none"))
    _add_wardrobe(commands.add_parser("wardrobe", help="transfer many garments to many bodies"))
    _add_weights(commands.add_parser("weights", help="store, restore, compare, export and import weights"))
    _add_refine(commands.add_parser("refine", help="bake refined skin to corrective keys or a point cache"))
    return _run(parser, arguments)


def transfer(arguments: list[str]) -> int:
    """The same without the word `transfer`, for the script."""
    description = "Transfer weights from a body to garments."
    parser = argparse.ArgumentParser(prog="transfer_weights.py", description=description)
    _add_transfer(parser)
    return _run(parser, arguments)


def sculpt(arguments: list[str]) -> int:
    """The same without the word `sculpt`, for the script."""
    description = "Turn recorded sculpts of a posed mesh into weights."
    parser = argparse.ArgumentParser(prog="sculpt_weights.py", description=description)
    _add_sculpt(parser)
    return _run(parser, arguments)


def retarget(arguments: list[str]) -> int:
    """The same without the word `retarget`, for the script."""
    description = "Take the weights of another character with a similar skeleton."
    parser = argparse.ArgumentParser(prog="retarget_weights.py", description=description)
    _add_retarget(parser)
    return _run(parser, arguments)


def automatic_weights(arguments: list[str]) -> int:
    """The same without the word `autoskin`, for the script."""
    description = "Compute weights for the bones of an armature from scratch."
    parser = argparse.ArgumentParser(prog="automatic_weights.py", description=description)
    _add_autoskin(parser)
    return _run(parser, arguments)


def embed_armature(arguments: list[str]) -> int:
    """The same without the word `embed`, for the script."""
    description = "Put the armature of another character into meshes that have none."
    parser = argparse.ArgumentParser(prog="embed_armature.py", description=description)
    _add_embed(parser)
    return _run(parser, arguments)


def wardrobe(arguments: list[str]) -> int:
    """The same without the word `wardrobe`, for the script."""
    parser = argparse.ArgumentParser(prog="wardrobe.py", description="Transfer many garments to many bodies.")
    _add_wardrobe(parser)
    return _run(parser, arguments)


def weights(arguments: list[str]) -> int:
    """The same without the word `weights`, for the script."""
    parser = argparse.ArgumentParser(prog="weights.py", description="Keep, bring back, compare weights.")
    _add_weights(parser)
    return _run(parser, arguments)


def refine(arguments: list[str]) -> int:
    """The same without the word `refine`, for the script."""
    parser = argparse.ArgumentParser(prog="refine.py", description="Bake refined skin.")
    _add_refine(parser)
    return _run(parser, arguments)


def _add_transfer(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--source", required=True, help="object whose weights are transferred")
    parser.add_argument("--target", required=True, action="append", help="object to transfer to; may be repeated")
    _add_common(parser, TransferParams())
    parser.set_defaults(work=_transfer, read=from_json, inputs=("settings",))


def _add_sculpt(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--target", required=True, help="object that was sculpted")
    parser.add_argument("--sculpts", required=True, type=Path, help=".npz file of positions and poses")
    _add_common(parser, SculptParams())
    parser.set_defaults(work=_sculpt, read=options_from_json, inputs=("settings", "sculpts"))


def _add_retarget(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--source", required=True, help="armature of the character whose weights are taken, or a mesh")
    parser.add_argument(
        "--target", required=True, action="append", help="mesh of the character that gets them; may be repeated"
    )
    _add_common(parser, RetargetParams())
    parser.set_defaults(work=_retarget, read=retarget_from_json, inputs=("settings",))


def _add_autoskin(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--target", required=True, action="append", help="mesh to compute weights for; may be repeated")
    parser.add_argument("--armature", help="object whose bones they follow; without it each mesh's own armature")
    _add_common(parser, autoskin.AutoskinParams())
    read_settings = lambda settings: declared.from_json(autoskin.AutoskinParams, settings)  # noqa: E731
    parser.set_defaults(work=_autoskin, read=read_settings, inputs=("settings",))


def _add_embed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("blend", nargs="?", type=Path, help="file to open first; without it the one that is open")
    parser.add_argument("--source", required=True, help="armature of the character that the bones are taken from")
    parser.add_argument("--target", required=True, action="append", help="mesh that gets them; may be repeated")
    _add_common(parser, embed.EmbedParams())
    read_settings = lambda settings: declared.from_json(embed.EmbedParams, settings)  # noqa: E731
    parser.set_defaults(work=_embed, read=read_settings, inputs=("settings",))


def _add_wardrobe(parser: argparse.ArgumentParser) -> None:
    wardrobe_command.add(parser)
    parser.set_defaults(run=wardrobe_command.run)


def _add_refine(parser: argparse.ArgumentParser) -> None:
    refine_command.add(parser)
    parser.set_defaults(run=lambda options: refine_command.run(options, _value))


def _add_weights(parser: argparse.ArgumentParser) -> None:
    weights_command.add(parser)
    parser.set_defaults(run=weights_command.run)


def _add_common(parser: argparse.ArgumentParser, default: Params) -> None:
    listed = ", ".join(f"{name} {json.dumps(value)}" for name, value in declared.to_json(default).items())
    parser.epilog = f"Settings and their defaults, angles in degrees: {listed}."
    parser.add_argument("--settings", type=Path, help="JSON object of settings")
    parser.add_argument("--report", type=Path, help="write what was done as JSON")
    parser.add_argument("--save", type=Path, help="save the result as this .blend file")
    parser.add_argument("--overwrite", action="store_true", help="let outputs replace any file that exists")
    group = parser.add_argument_group("settings, each also a name in the file of --settings, which they overrule")
    for name, (kind, one) in declared.declared(type(default)).items():
        if declared.is_plain(kind):
            sentence = declared.described(kind, one, getattr(default, name)).replace("%", "%%")
            group.add_argument(f"--{name.replace('_', '-')}", metavar="VALUE", dest=f"set {name}", help=sentence)


def _run(parser: argparse.ArgumentParser, arguments: list[str]) -> int:
    """The net under every command: whatever happens comes to a sentence on stderr and an exit code."""
    try:
        options = parser.parse_args(arguments)
        if hasattr(options, "run"):
            return options.run(options)
        params = _params(parser, options)
        report = _work(options, params)
        _write_report(options, params, report)
    except SystemExit as leave:  # argparse has said what is wrong; a host application must not be ended by it
        return leave.code if isinstance(leave.code, int) else USAGE
    except (Refused, OSError) as error:
        print(f"skinwright: {error}", file=sys.stderr)
        return FAILED
    except Exception as error:
        print(f"skinwright: {internal(error)}", file=sys.stderr)
        return FAILED
    for warning in report.all_warnings():
        print(f"skinwright: warning: {warning}", file=sys.stderr)
    print(report.sentence())
    return DONE


def _params(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Params:
    try:
        settings = _settings_of(options)
        return options.read(settings)
    except SettingError as error:
        raise _Failure(f"{_origin(options)}{error}") from error
    except (OSError, ValueError, RecursionError) as error:
        problem = "it is nested too deeply" if isinstance(error, RecursionError) else error
        parser.error(f"{_origin(options)}{problem}")


def _origin(options: argparse.Namespace) -> str:
    return f"--settings {options.settings}: " if options.settings else ""


def _settings_of(options: argparse.Namespace) -> Any:
    """Those of the file, overruled by those of the command line."""
    settings = json.loads(options.settings.read_text(encoding="utf-8-sig")) if options.settings else {}
    given = {name.removeprefix("set "): text for name, text in vars(options).items() if name.startswith("set ")}
    given = {name: _value(text) for name, text in given.items() if text is not None}
    return settings | given if given and isinstance(settings, dict) else settings


def _value(text: str) -> Any:
    """A number, true, false or null as JSON writes it; everything else is a text."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text


def _work(options: argparse.Namespace, params: Params) -> AnyReport:
    if native.problem():
        raise _Failure(native.problem())
    _check_outputs(options)
    if options.blend:
        blend_file.open_file(options.blend)
    report = options.work(options, params)
    if options.save:
        blend_file.save_copy(options.save)
    return report


def _check_outputs(options: argparse.Namespace) -> None:
    """Before anything is done: no output may cost a file."""
    inputs = [path for name in options.inputs if (path := getattr(options, name))]
    blends = [options.blend] if options.blend else blend_file.opened()
    if options.report:
        others = [*inputs, *blends, *([options.save] if options.save else [])]
        files.check_output(options.report, others=others, overwrite=options.overwrite, replaces=files.REPORT)
    if options.save:  # also over the file that was opened, but only if asked to
        files.check_output(options.save, others=inputs, overwrite=options.overwrite)


def _transfer(options: argparse.Namespace, params: TransferParams) -> Report:
    return transfer_weights(
        bpy.context, object_named(options.source), [object_named(n) for n in options.target], params
    )


def _retarget(options: argparse.Namespace, params: RetargetParams) -> RetargetReport:
    targets = [mesh_named(name) for name in options.target]
    return retarget_weights(bpy.context, object_named(options.source), targets, params)


def _autoskin(options: argparse.Namespace, params: autoskin.AutoskinParams) -> AutoskinReport:
    rig = object_named(options.armature) if options.armature else None
    return autoskin.automatic_weights([mesh_named(name) for name in options.target], rig, params)


def _embed(options: argparse.Namespace, params: embed.EmbedParams) -> embed.EmbedReport:
    targets = [mesh_named(name) for name in options.target]
    return embed.embed_armature(bpy.context, object_named(options.source), targets, params)


def _sculpt(options: argparse.Namespace, params: SculptParams) -> SculptReport:
    return replay(mesh_named(options.target), read(options.sculpts), params)


def _write_report(options: argparse.Namespace, params: Params, report: AnyReport) -> None:
    if options.report:
        content: dict[str, Any] = {"version": native.addon_version(), "settings": _shown(params)}
        files.write_report(options.report, content | report.to_json(), overwrite=options.overwrite)


def _shown(params: Params) -> dict[str, Any]:
    return retarget_to_json(params) if isinstance(params, RetargetParams) else declared.to_json(params)


_commands: list[object] = []  # what Blender gives back for taking the command away


def register() -> None:
    """Register `blender -c skinwright`."""
    _commands.append(bpy.utils.register_cli_command("skinwright", main))


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_cli_command(_commands.pop())
