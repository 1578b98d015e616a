"""`validate list --plugins`: parts of installed plug-ins, with package and version."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from importlib import import_module

from validate.catalogue import folder_of_experiments
from validate.commands.screen import rows
from validate.plugins import PlugIn, plug_ins

_HOMES: Mapping[str, tuple[str, ...]] = {
    "readers": ("recording.readers", "READERS"),
    "schemes": ("solve.schemes", "SCHEMES", "SOLVERS"),
    "filters": ("estimate.filters", "FILTERS"),
    "laws": ("scene.laws", "LAWS"),
    "sensors": ("register.sensing", "SENSORS"),
    "views": ("report.views.standard", "VIEWS"),
    "simulators": ("solve.external.program", "SIMULATORS"),
}


def show(as_json: bool) -> None:
    """Print every installed plug-in: kind, name, package, version and whether it is used."""
    kinds = sorted({plug_in.kind for plug_in in plug_ins()})
    states: dict[PlugIn, str] = {}  # why each is left out; "" for one that is used
    for kind in kinds:
        if kind == "experiments":
            for plug_in in plug_ins(kind):
                there = folder_of_experiments(plug_in)
                states[plug_in] = "" if there else "its folder is absent"
        else:
            module, *names = _HOMES[kind]
            home = import_module(f"validate.{module}")
            states |= {p: why for name in names for p, why in getattr(home, name).states}
    if as_json:
        listed = [{**asdict(plug_in), "left_out": why} for plug_in, why in states.items()]
        print(json.dumps(listed, ensure_ascii=False, indent=2))
    elif states:
        cells = [[p.kind, p.name, p.package, p.version, "left out" if why else "used"]
                 for p, why in states.items()]  # fmt: skip
        for line in rows(["kind", "name", "package", "version", ""], cells):
            print(line)
    else:
        print("no plug-ins are installed; docs/developers/plugins.md shows how to write one")
