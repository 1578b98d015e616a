"""How the measurement was brought into the scene's frame, and what that leaves."""

import numpy as np
from matplotlib.figure import Figure

from validate.arrays import Floats, rms
from validate.compare.residual import Residual
from validate.compare.result import Result
from validate.compare.score import max_length
from validate.register.observe import MarkerObservation
from validate.register.quality import Registration
from validate.report.numbers import shown_unit, text, with_unit
from validate.report.page import (
    Cell,
    Items,
    Paragraph,
    Picture,
    Section,
    Table,
    cells,
    section,
)
from validate.report.style import MEASURED, draw

_MM = 1e3
_MAGNIFIED = 5.0
_NAMED = 60  # markers; the names of more would hide each other


def registration(result: Result) -> Section | None:
    """Method, FRE, FLE, predicted TRE, residuals of every marker; rest residuals."""
    seen = result.registered[0].markers if result.registered else None
    return section(
        "registration",
        "Registration",
        _quality(result, seen) if seen else None,
        _findings(seen.registration) if seen else None,
        _vectors(seen.registration) if seen else None,
        _rest(result.rest),
        _residuals(seen) if seen else None,
    )


def _quality(result: Result, seen: MarkerObservation) -> Table:
    found = seen.registration
    centre = target(result)
    rows = [
        ("method", found.method, "fitted once, on the rest state, then frozen"),
        ("markers in the fit", str(found.k_effective), f"{len(found.missing)} not seen, "
         f"{len(found.excluded)} excluded, {len(found.outliers)} outliers"),
        ("declared noise", with_unit(found.expected_sd, "m"), "standard deviation per axis"),
        ("FRE", with_unit(found.fre, "m"), "rms residual at the markers; no measure of accuracy"),
        ("FLE", with_unit(found.fle, "m"), "rms localisation error of one marker, from the FRE"),
        ("TRE at the markers", with_unit(float(rms(seen.tre[:, None])), "m"), "predicted, rms"),
    ]  # fmt: skip
    if centre is not None:
        tre = float(found.tre_at(centre[None])[0])
        rows.append(
            ("TRE at the inclusion", with_unit(tre, "m"), "predicted at the cavity's centre")
        )
    return Table(
        "Marker registration.",
        ("", "value", "meaning"),
        tuple(cells(*r) for r in rows),
        words=(0, 2),
    )


def target(result: Result) -> Floats | None:
    """The centre (3,) m of the first cavity of the first scene; None without one."""
    for method in result.methods:
        if method.scene.cavities:
            nodes = method.scene.mesh.facet_nodes(method.scene.cavities[0].facets)
            return np.asarray(method.scene.mesh.nodes[nodes].mean(axis=0))
    return None


def _findings(found: Registration) -> Items | Paragraph:
    if found.findings:
        return Items(found.findings)
    return Paragraph("No findings: no outlier, no mirror image, no permuted labels.")


def _vectors(found: Registration) -> Picture:
    pixels = draw(lambda f: _vector_axes(f, found), 6.4, 5.2)
    seen = "y" if found.markers.shape[1] == 3 else "the normal of their plane"
    return Picture(
        "registration",
        "Registration residuals of the markers at rest, mapped less target, in mm, seen along "
        f"{seen}; arrows magnified {_MAGNIFIED:g} times. A pattern "
        "(all outward, all turned) would mean a wrong scale or rotation; noise has none.",
        "Arrows of the registration residual at each marker, without a common direction if only "
        "noise is left.",
        pixels,
    )


def _vector_axes(figure: Figure, found: Registration) -> None:
    ax = figure.subplots()
    axes = [0, 2] if found.markers.shape[1] == 3 else [0, 1]
    x, r = _MM * found.markers[:, axes], _MAGNIFIED * _MM * found.residuals[:, axes]
    ax.quiver(*x.T, *r.T, angles="xy", scale_units="xy", scale=1, color=MEASURED, width=0.004)
    ax.plot(*x.T, ".", color="#D55E00", ms=4)
    named = zip(found.names, x, strict=True) if len(x) <= _NAMED else ()
    for name, (a, b) in named:
        ax.annotate(name, (a, b), xytext=(2, -8), textcoords="offset points", fontsize=6.5,
                    color="#5A5A5A")  # fmt: skip
    ax.set_title(f"residuals, magnified {_MAGNIFIED:g} times")
    ax.set(xlabel="x / mm", ylabel=f"{'z' if axes[1] == 2 else 'y'} / mm", aspect="equal")
    ax.margins(0.12)


def _rest(rest: tuple[Residual, ...]) -> Table | None:
    if not rest:
        return None
    rows = tuple(
        (
            *cells(r.name, shown_unit(r.unit), text(rms(r.values), r.unit)),
            *cells(text(max_length(r.values), r.unit)),
            *cells(text(float(np.sqrt(r.values.shape[1])) * r.sd, r.unit), str(r.count)),
        )
        for r in rest
    )
    return Table(
        "What registration and geometry leave at rest, before any load; noise: the rms that a "
        "perfect model would show.",
        ("residual", "unit", "rms", "max", "noise", "values"),
        rows,
        words=(0, 1),
    )


def _residuals(seen: MarkerObservation) -> Table:
    found = seen.registration
    outliers = {o.name for o in found.outliers}
    rows = tuple(
        (
            Cell(name),
            *(Cell(text(v, "m")) for v in r),
            Cell(text(float(np.linalg.norm(r)), "m")),
            Cell("outlier" if name in outliers else "", "bad" if name in outliers else ""),
        )
        for name, r in zip(found.names, found.residuals, strict=True)
    )
    columns = "xyz"[: found.residuals.shape[1]]
    return Table(
        "Registration residual of every marker, mm.",
        ("marker", *columns, "length", ""),
        rows,
        words=(0, len(columns) + 2),
        folded=True,
    )
