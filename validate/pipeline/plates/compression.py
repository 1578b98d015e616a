"""Experiment of a compression or tension test, from a log of displacement and force.

The body is a cylinder or a mesh file (`pipeline.plates.scene`). Displacement counts from contact
less the toe (where the fitted line reaches zero force), force from the cell's own offset; the first
window of strain fits the modulus where none is given, the second predicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, UsageError
from validate.identify.modulus import MIN_SAMPLES, ModulusFit
from validate.pipeline.bodies.mesh import DIAMETER
from validate.pipeline.calibration.fitted_moduli import toe_in
from validate.pipeline.experiment.experiment import (
    CORNER_ORDER,
    Change,
    Experiment,
    Input,
    MeshLadder,
    Uncertainty,
    vary,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import (
    CellSize,
    ScaledBody,
    Tree,
    beside,
    changed_by,
    mesh_of,
)
from validate.pipeline.plates.modulus import identify_pressed
from validate.pipeline.plates.outline import MODULI, OUTLINE_INPUTS, stiffer, with_outline
from validate.pipeline.plates.scene import (
    BuiltPressed,
    by_model,
    kind_of_test,
    pressed_log,
    pressed_size,
    stated_sizes,
)
from validate.pipeline.run.cost import INPUTS, NODAL_MEAN, affordable, linear_seconds
from validate.recording.merge import repeats_share
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.geometries.specification import Cylinder, MeshFile
from validate.scene.scene import Scene

_LOAD_STEPS = 20  # of a table of loads at large strain, to the strain limit


def compression(
    name: str,
    title: str,
    source: str,
    parameters: Tree,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    kind: Kind = "measured",
    *,
    folder: Path = Path(),
) -> Experiment:
    """Return the experiment: `force` is judged in the windows "fit" and "beyond", outlines that the
    settings name at images of their own.

    `folder` is that of the experiment's file, from which a mesh file is found. Raises `UsageError`
    for a scene that is not of this kind.
    """
    kind_of_test(parameters)
    shown = parameters.settings.outline.topic is not None
    if shown and getattr(parameters.scene.body, "part", "whole") != "whole":
        raise UsageError(
            "body.part: outlines show all of the body, not a quarter; declare part='whole' and "
            "Support('lower_plate', (2,), rests=True)"
        )
    filed, build = isinstance(parameters.scene.body, MeshFile), BuiltPressed(folder)
    # A mesh file has no coarser ones. The corners of bonded plates limit the order.
    levels = (_halved(1), _halved(2)) if filed else (ScaledBody(0.5), ScaledBody(0.75), _finer)
    ladder = MeshLadder(levels, CellSize(folder), CORNER_ORDER)
    inputs = (
        vary(MODULI, "relative ranges.E", "modulus", "E within its declared uncertainty"),
        Input("diameter", _wider_body if shown else _stiffer_by_area,
              "diameter within its declared range", "assumed"),
        *(OUTLINE_INPUTS if shown else ()),
    )  # fmt: skip
    return Experiment(
        name, title, source, parameters, methods, accepted, accept, beside, build,
        partial(_place, folder=folder, shown=shown), sets=partial(_sets, folder=folder),
        stated=stated_sizes,
        identify=partial(
            identify_pressed, build=build, ladder=ladder, accepted=accepted,
            declared=inputs if shown else (),
        ),
        follows=partial(_affordable, folder=folder),
        refine=_refined,
        frames=2,
        kind=kind,
        uncertainty=Uncertainty(mesh=ladder, inputs=inputs, surrogate=accepted[0]),
    )  # fmt: skip


def _refined(tree: Tree, folder: Path) -> Mapping[str, str]:
    """What --refine sets: of a mesh file its own mesh, and no time limit."""
    body = tree.scene.body
    if not isinstance(body, MeshFile):
        return {}
    return {"mesh.budget": "false", **({"body.halvings": "0"} if body.halvings < 0 else {})}


def _affordable(
    experiment: Experiment, recordings: Sequence[Recording], tree: Tree, *, folder: Path
) -> Experiment:
    """The experiment with those halvings of a mesh file that fit into memory and `mesh.budget`;
    where its inputs are dear, they are moved one by one only."""
    declared = experiment.uncertainty
    if not isinstance(tree.scene.body, MeshFile) or declared is None or declared.mesh is None:
        return experiment
    budget = tree.settings.mesh.budget
    first = changed_by(tree, experiment.methods[experiment.accepted[0]].scene or {})
    N = mesh_of(None, first, folder).nodes.size
    coarser = -tree.scene.body.halvings  # its own mesh is then the finest
    finer = declared.mesh.levels[: coarser if coarser > 0 else None]
    costs = N * NODAL_MEAN if first.scene.dilatation == "nodal_mean" else N
    levels = affordable(finer, [8 * costs, 64 * costs][: len(finer)], budget=budget)
    ladder = replace(declared.mesh, levels=levels or (_halved(-1),))
    runs = 1 + len(declared.inputs) + declared.draws
    dear = budget and runs * linear_seconds(costs) > INPUTS
    return replace(
        experiment,
        uncertainty=replace(declared, mesh=ladder, draws=0 if dear else declared.draws),
        identify=partial(cast("partial[Any]", experiment.identify), ladder=ladder),
    )


# --- the recording in it --------------------------------------------------------------------------


def _place(
    recording: Recording, tree: Tree, scene: Scene, *, folder: Path, shown: bool
) -> Registered:
    p, size, test = tree.settings, pressed_size(tree, folder), kind_of_test(tree)
    if p.outline.topic is not None and not shown:
        raise UsageError(
            "outline.topic: the uncertain inputs of outlines are chosen in the experiment's file; "
            "name the topic there, PressedOutline(topic=...)"
        )
    fit = ModulusFit.of(recording, size, (p.fit_from, p.fit_to), test)
    noise = max(fit.noise, recording.signal("force", "N").sd)
    strains = {"fit": (p.fit_from, p.fit_to), "beyond": (p.fit_to, p.limit)}
    seen = pressed_log(
        recording, fit, size.height, p.limit, strains, noise,
        share=repeats_share(recording), test=test,
        toe=toe_in(p.by_method, by_model(scene)) if p.by_method else None,
    )  # fmt: skip
    for window in seen.selections:
        if window.t is not None and len(window.t) < MIN_SAMPLES:
            raise ComparisonError(
                f"window '{window.label}': {len(window.t)} samples of {recording.name}; "
                f"{MIN_SAMPLES} are needed to check a prediction: widen fit_from, fit_to or limit"
            )
    if p.outline.topic is None:
        return seen
    return with_outline(seen, recording, p.outline, scene.mesh)


def _sets(tree: Tree, seen: Registered, *, folder: Path) -> Mapping[str, Any]:
    """Large strain is solved on a grid of loads to the limit."""
    height = pressed_size(tree, folder).height
    return {"step": tree.settings.limit * height / _LOAD_STEPS}


# --- what is uncertain ----------------------------------------------------------------------------


def _finer(tree: Tree) -> Tree:
    return ScaledBody(tree.settings.mesh.finer)(tree)


def _halved(times: int) -> Change:
    """The mesh file with its cells' edges halved so many times more."""

    def change(tree: Tree) -> Tree:
        body = tree.scene.body
        return tree.with_scene(body=replace(body, halvings=body.halvings + times))

    return change


def _wider_body(tree: Tree, z: float) -> Tree:
    """Of a mesh file, whose shape is its own, only the force is changed."""
    body = tree.scene.body
    if not isinstance(body, Cylinder) or body.diameter is None:
        return _stiffer_by_area(tree, z)
    by = 1 + z * tree.settings.ranges.diameter
    return tree.given({DIAMETER: body.diameter * by})


def _stiffer_by_area(tree: Tree, z: float) -> Tree:
    """A wider specimen is as much stiffer as its area is larger."""
    return stiffer(tree, (1 + z * tree.settings.ranges.diameter) ** 2)
