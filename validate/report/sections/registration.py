"""Registration section: transform to the scene's frame and its residuals."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import rms
from validate.compare.exhibit import Entry, Exhibit, NumberTable, TableCell
from validate.compare.result import Result
from validate.compare.score import max_length
from validate.numbers import shown_unit, with_unit
from validate.register.markers.quality import AsDeclared
from validate.report.scenes.residual_arrows import residual_arrows
from validate.report.sections.observations import markers
from validate.report.views.view_filling import Shown, sized, table

_DECLARED = ("Nothing was fitted: the markers were recorded in the body's frame, as declared.",)
_CLEAN = ("No findings: no outlier, no mirror image, no permuted labels.",)


def registration(result: Result) -> Exhibit:
    """Method, FRE, FLE, predicted TRE, residuals of every marker; rest residuals."""
    seen = markers(result.registered[0]) if result.registered else None
    columns: Mapping[str, Shown] = {
        "residual": "name", "unit": lambda r: shown_unit(r.unit),
        "rms": sized(lambda r: rms(r.values)), "max": sized(lambda r: max_length(r.values)),
        "noise": sized(lambda r: float(np.sqrt(r.values.shape[1])) * r.sd), "values": "count",
    }  # fmt: skip
    title = (
        "Errors of registration and geometry at rest, before any load; noise: the rms of a "
        "perfect model."
    )
    rest = (table("", title, result.rest, columns),) if result.rest else ()
    if seen is None:
        return Exhibit("registration", "Registration", (), rest)
    found, head = seen.registration, ("", "value", "meaning")
    noise = ("declared noise", with_unit(found.expected_sd, "m"), "standard deviation per axis")
    if isinstance(found, AsDeclared):
        count = ("markers", str(found.k_effective), "in the body's frame as recorded")
        recorded = NumberTable("", "Markers as recorded.", head, (count, noise))
        return Exhibit("registration", "Registration", _DECLARED, (recorded, *rest))
    rows = [
        ("method", found.method, "fitted once, on the rest state, then frozen"),
        ("markers in the fit", str(found.k_effective), f"{len(found.missing)} not visible, "
         f"{len(found.excluded)} excluded, {len(found.outliers)} outliers ("
         f"{len(found.rejected)} left out by a robust fit); all visible markers are compared"),
        ("fitted scale", f"{found.scale.value:.5f} ± {found.scale.half:.2g}",
         f"markers over layout, 99.9 %; {'not ' * (found.transform.s == 1)}used"),
        noise,
        ("FRE", with_unit(found.fre, "m"), "rms residual at the markers; not a measure of "
                                           "accuracy"),
        ("FLE", with_unit(found.fle, "m"), "rms localisation error of one marker, from the FRE"),
        ("TRE at the markers", with_unit(float(rms(seen.tre[:, None])), "m"), "predicted, rms"),
    ]  # fmt: skip
    scene = result.methods[0].scene
    for cavity in scene.cavities:
        nodes = scene.mesh.nodes[scene.mesh.facet_nodes(cavity.facets)]
        tre = with_unit(float(found.tre_at(nodes.mean(axis=0)[None])[0]), "m")
        rows.append((f"TRE at {cavity.name}", tre, "predicted at the cavity's centre"))
    quality = NumberTable("", "Marker registration.", head, tuple(rows))
    return Exhibit(
        "registration", "Registration", found.findings or _CLEAN,
        (quality, *rest, _residuals(result)), pictures=(residual_arrows(found),),
    )  # fmt: skip


def _residuals(result: Result) -> NumberTable:
    """Where every marker lies and what its registration leaves, of every recording."""
    rows: list[tuple[Entry | TableCell, ...]] = []
    unit = TableCell("m", text=shown_unit("m"))
    for recording, registered in zip(result.recordings, result.registered, strict=False):
        if (seen := markers(registered)) is None:
            continue
        found = seen.registration
        outliers = {o.name for o in found.outliers}
        for name, at, off in zip(found.names, found.markers, found.residuals, strict=True):
            three = (v for vector in (at, off) for v in (*vector.tolist(), None)[:3])
            lengths = (*three, float(np.linalg.norm(off)))
            bad = name in outliers
            finding = TableCell("outlier" if bad else "", emphasis="bad" if bad else "")
            cells = (TableCell(v, "m") for v in lengths)
            rows.append((recording.name, name, *cells, unit, finding))
    return NumberTable(
        "registration",
        "Registration residual of every marker.",
        ("recording", "marker", "x", "y", "z", "residual_x", "residual_y", "residual_z", "length",
         "unit", "finding"),
        tuple(rows),
        folded=True,
    )  # fmt: skip
