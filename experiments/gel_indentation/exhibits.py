"""What `gel_indentation` shows: both boxes' errors against the floor, what the choice of a box does
to the Poisson ratio, and how far the links are to be trusted."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from validate.arrays import Floats, rms
from validate.compare.exhibit import Exhibit, NumberTable
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.register.markers.displacements import DisplacementObservation

from .box import GelIndentation, Same, load
from .displacement_errors import GelErrors, in_lower, strains
from .particles import checked_links, files, side_of
from .poisson_ratio import GelRatio, between

_OVER = "rms errors of displacement vectors over the"


def tell(
    tree: Tree,
    cases: Cases,
    progress: Progress,
    *,
    methods: Mapping[str, Method],
    home: Path,
) -> ReportAdditions:
    """Tables and maps of the particles judged, and the ratios of prediction to floor. `methods`
    are those of the lower box; `home` is the experiment's folder."""
    whose, box = Same(load(tree, home)[0]), tree.scene.body
    main = {name: f for name, f in cases[""].items() if f.run.finished}
    (seen,) = next(iter(main.values())).seen.of(DisplacementObservation)
    errors = {name: _errors(f) for name, f in main.items()}
    judged = GelErrors(seen, errors, strains(whose, box, seen))
    progress("errors inside")
    shown = (
        _inside(judged, box.which, main),
        _calibrated(in_lower(whose, tree, methods), between(whose, box)),
        _linked(whose, tree.settings, home, progress),
    )
    return ReportAdditions(
        shown, {f"ratio.{n}": rms(e) / rms(judged.floor) for n, e in errors.items()}
    )


def _errors(followed: MethodRun) -> Floats:
    (seen,) = followed.registered[0].of(DisplacementObservation)
    return seen.simulated(followed.run.u[-1]) - seen.u


def _inside(judged: GelErrors, which: str, main: Mapping[str, MethodRun]) -> Exhibit:
    unknown = (
        "Displacement alone identifies the Poisson ratio and no modulus: every force has an "
        "unknown unit."
    )
    return Exhibit(
        "inside", f"Errors inside the {which} box", (*judged.words(), unknown),
        (judged.over_strain("errors_over_strain", f"The {which} box: {_OVER} strain norm"),
         judged.over_height("errors_over_height", f"The {which} box: {_OVER} height")),
        heats=tuple(judged.map(name, f.label) for name, f in main.items()),
    )  # fmt: skip


def _calibrated(judged: GelErrors, found: Sequence[GelRatio]) -> Exhibit:
    rows = tuple(
        (
            f.box,
            f.neighbours,
            f.count,
            round(f.nu, 3),
            None if f.sd is None else round(f.sd, 4),
            round(f.over_floor, 3),
        )
        for f in found
    )
    table = NumberTable(
        "nu_between_boxes", "The Poisson ratio fitted in other boxes (linear law)",
        ("box", "neighbours (1)", "particles (1)", "nu (1)", "standard deviation (1)",
         "error / floor (1)"), rows,
        note="The standard deviation is that of noise and misfit in that box; it is absent "
             "where the ratio ended at a bound. The scatter between rows is the input 'box'. "
             "A coarser mesh than the prediction's.",
    )  # fmt: skip
    return Exhibit(
        "lower", "The lower box and other boxes: fitted, no evidence", judged.words(),
        (judged.over_strain("lower_over_strain", f"The lower box: {_OVER} strain norm"), table),
    )  # fmt: skip


def _linked(whose: Same, p: GelIndentation, home: Path, progress: Progress) -> Exhibit:
    progress("links backward, and of a known pair")
    pair = files(p.data, (p.before, p.after), home)
    table = checked_links(whose.recording, pair, side_of(p.voxel, pair[0]))
    words = (
        "Linked backward, from after to before, a particle should be linked to the same "
        "particle as forward. On a pair with known links every wrong link is counted.",
    )
    return Exhibit("links", "Check of the links", words, (table,))
