"""Transfers without an operator, and what they say."""

import bpy


def transfer(addon, source: bpy.types.Object, *targets: bpy.types.Object, **settings):
    """The report of a transfer with settings by name."""
    params = addon.transfer.TransferParams(**settings)
    return addon.transfer.transfer_weights(bpy.context, source, list(targets), params)


def said(report) -> str:
    """All warnings in one line."""
    return " | ".join(report.all_warnings())
