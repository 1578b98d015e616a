"""Laws identified in one mode and judged in others: exact curves, a plane, natural rubber."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beside import beside

from validate.errors import RecordingError, UsageError
from validate.fem.laws.plane_stress import response
from validate.pipeline import load as load_experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording
from validate.scene.meshless import StretchMode

curves_module, laws = beside("multimode", "curves"), beside("multimode", "laws")
ranking = beside("multimode", "ranking")
Multimode, mode_of, point = curves_module.Multimode, curves_module.mode_of, curves_module.point
MooneyRivlin, OgdenTerms, material = laws.MooneyRivlin, laws.OgdenTerms, laws.material
LawError, RankedLaw = ranking.LawError, ranking.RankedLaw
better_fit_worse_prediction = ranking.better_fit_worse_prediction


def load(settings: Any, folder: Path) -> tuple[Recording, ...]:
    found: tuple[Recording, ...] = curves_module.load(Tree(settings=settings), folder)
    return found


C10, C01 = 150e3, 30e3
TRUE = Multimode(mooney_rivlin=MooneyRivlin(C10, C01))
L = np.linspace(1.0, 2.2, 9)
MODES: tuple[StretchMode, ...] = ("uniaxial", "equibiaxial", "pure_shear")


def curves(folder: Path, *modes: StretchMode, name: str = "exact") -> Path:
    """Exact Mooney-Rivlin, as such files are written."""
    for mode in modes or MODES:
        P = response(point(TRUE, "mooney_rivlin", mode), L)["nominal_stress"]
        rows = "".join(f"{l:.9g},{p / 1e6:.9g}\n" for l, p in zip(L, P, strict=True))
        (folder / f"{name}_{mode}.csv").write_text(f"stretch_[-],nominal_stress_[MPa]\n{rows}")
    return folder


def plane(folder: Path) -> Path:
    pairs = np.array([(a, b) for a in (1.2, 1.6, 2.0) for b in (a**-0.5, 0.95, 1.0, 1.1, a)])
    found = response(point(TRUE, "mooney_rivlin", "biaxial"), pairs)
    P = np.stack([found["nominal_stress"], found["second_stress"]], axis=1) / 1e6
    rows = "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in np.hstack([pairs, P]))
    head = "stretch_1_[-],stretch_2_[-],nominal_stress_1_[MPa],nominal_stress_2_[MPa]\n"
    (folder / "exact_biaxial.csv").write_text(head + rows)
    return folder


def test_a_law_that_is_not_the_material_s_is_said_to_differ(tmp_path: Path) -> None:
    options = Options({"data": str(curves(tmp_path))}, methods=("neo_hooke",))
    result = compare(load_experiment("multimode"), options)
    assert {s.name for s in result.identified} == {"neo_hooke.mu"}
    verdicts = {c.name: c.verdict for c in result.checks}
    assert verdicts["stress.equibiaxial.max@all"] == "not good enough"
    assert result.title.startswith("exact: identified in uniaxial tension")
    assert "predicted: stress.equibiaxial" in result.sentence


@pytest.mark.slow
def test_the_material_s_law_predicts_the_other_modes(tmp_path: Path) -> None:
    read = {"data": str(curves(tmp_path)), "ranges.reading": "0.002", "ranges.axis": "0.002"}
    options = Options(read, methods=("neo_hooke", "mooney_rivlin"))
    result = compare(load_experiment("multimode"), options)
    found = {s.name: s.value for s in result.identified}
    assert found["mooney_rivlin.C10"] == pytest.approx(C10, rel=1e-3)
    assert found["mooney_rivlin.C01"] == pytest.approx(C01, rel=1e-2)
    verdicts = {(m.name, c.name): c.verdict for m in result.methods for c in m.checks}
    assert verdicts["mooney_rivlin", "stress.equibiaxial.max@all"] == "good enough"
    assert verdicts["neo_hooke", "stress.equibiaxial.max@all"] == "not good enough"
    assert "each by itself on stress.uniaxial of the uniaxial tension curve" in result.sentence


def test_modes_that_a_material_lacks_are_not_asked_for(tmp_path: Path) -> None:
    found = load(Multimode(data=str(curves(tmp_path, "equibiaxial", "pure_shear"))), tmp_path)
    assert [mode_of(r) for r in found] == ["equibiaxial", "pure_shear"]
    assert [r.record("test")["role"] for r in found] == ["calibrates", "validates"]
    fitted = load(Multimode(data=str(tmp_path), fit="pure_shear"), tmp_path)
    assert mode_of(fitted[0]) == "pure_shear"


def test_a_curve_alone_is_identified_and_predicts_nothing(tmp_path: Path) -> None:
    laws = {"data": str(curves(tmp_path, "uniaxial")), "svk.mu": "1e5", "yeoh.C10": "1e5"}
    taken = {"mooney_rivlin.C10": "1e5", "mooney_rivlin.C01": "0", "yeoh.C20": "0", "yeoh.C30": "0",
             "ogden.G": "2e5", "ogden.alpha": "2", "ogden_two.G_1": "2e5", "ogden_two.alpha_1": "2",
             "ogden_two.G_2": "1e5", "ogden_two.alpha_2": "-2"}  # fmt: skip
    result = compare(load_experiment("multimode"), Options({**laws, **taken}))
    assert "predicted: nothing" in result.sentence
    assert result.checks == ()
    assert not result.passed


def test_a_plane_falls_into_its_lines_and_what_lies_between(tmp_path: Path) -> None:
    found = load(Multimode(data=str(plane(tmp_path))), tmp_path)
    assert [mode_of(r) for r in found] == ["equibiaxial", "uniaxial", "pure_shear", "biaxial"]
    assert [len(r.signal("stress", "Pa").y) for r in found] == [3, 3, 3, 6]
    shapes = [r.signal("stretch", "1").y.shape[1] for r in found]
    assert shapes == [1, 1, 1, 2]
    assert found[2].signal("stress", "Pa").y.shape == (3, 2)  # the second one is measured too


def test_what_cannot_be_found_is_said_with_the_choice_there_is(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no curves in .*MATERIAL_MODE\.csv"):
        load(Multimode(data=str(tmp_path)), tmp_path)
    curves(tmp_path, name="one")
    curves(tmp_path, name="two")
    with pytest.raises(UsageError, match=r"2 materials .*material=one\|two"):
        load(Multimode(data=str(tmp_path)), tmp_path)
    with pytest.raises(UsageError, match=r"no curves of three in"):
        load(Multimode(data=str(tmp_path), material="three"), tmp_path)
    with pytest.raises(UsageError, match=r"curve of 'one'.*equibiaxial\|pure_shear"):
        load(Multimode(data=str(tmp_path), material="one", fit="biaxial"), tmp_path)


def test_a_law_with_open_coefficients_makes_no_material() -> None:
    with pytest.raises(UsageError, match=r"ogden_two.G_1 is not set"):
        material("ogden_two", OgdenTerms(), 0.4999)
    made = material("ogden_two", OgdenTerms(3e5, 2.0, 1e5, -2.0), 0.4999)
    assert made.shear_modulus == pytest.approx(4e5)
    pulled = response(point(Multimode(ogden_two=OgdenTerms(3e5, 2.0, 1e5, -2.0)), "ogden_two",
                            "uniaxial"), L)["nominal_stress"]  # fmt: skip
    # Powers 2 and -2 are Mooney-Rivlin with C10 = G_1/2, C01 = G_2/2.
    exact = 2 * (L - L**-2) * (1.5e5 + 0.5e5 / L)
    assert pulled == pytest.approx(exact, rel=2e-3)


def ranked(name: str, fit: float, predicted: float, doubt: float) -> RankedLaw:
    draws = np.linspace(-doubt, doubt, 101)
    later = LawError(predicted, predicted + draws[::-1])
    return RankedLaw(name, name, LawError(fit, fit + draws), {}, later, None, {})


def test_fits_better_predicts_worse_is_said_beyond_doubt_alone() -> None:
    sure = [ranked("plain", 0.2, 0.1, 0.01), ranked("rich", 0.05, 0.3, 0.01)]
    ((one, other),) = better_fit_worse_prediction(sure)
    assert (one.method, other.method) == ("rich", "plain")
    assert better_fit_worse_prediction([sure[0], ranked("rich", 0.05, 0.3, 0.5)]) == []
    assert better_fit_worse_prediction([sure[0], ranked("good", 0.05, 0.05, 0.01)]) == []


@pytest.mark.slow
def test_natural_rubber_of_1944(shared_data: Path) -> None:
    """Neo-Hooke's modulus and errors on Treloar's rows by a closed form (least squares of P/f - 1):
    mu = sum(f/P) / sum((f/P)^2)."""
    result = compare(load_experiment("multimode"), Options({}))
    curve = load(Multimode(), Path())[0]
    l, P = (curve.signal(*s).y[1:, 0] for s in (("stretch", "1"), ("stress", "Pa")))
    f = (l - l**-2) / P
    (mu,) = (s.value for s in result.identified if s.name == "neo_hooke.mu")
    assert mu == pytest.approx(f.sum() / (f**2).sum(), rel=2e-3)
    (exhibit,) = (e for e in result.exhibits if e.anchor == "laws-by-prediction")
    table = exhibit.tables[0]
    assert table.rows[0][0] == "neo-Hooke"
    errors = {row[0]: row[table.headings.index("predicted, all / %")] for row in table.rows}
    assert errors["neo-Hooke"] == pytest.approx(14.7, abs=0.3)
    assert errors["Yeoh"] == pytest.approx(16.3, abs=0.3)
    assert any("fits best (2.3 %" in words for words in exhibit.words)
    assert any("loses positive energy" in words for words in exhibit.words)
    assert any("Ogden, two terms is not ranked" in words for words in exhibit.words)
    states = {m.name: m.run.outcome.state for m in result.methods}
    assert states["svk"] == states["ogden_two"] == "refused"


def test_two_curves_of_one_mode_and_planes_that_are_none_are_refused(tmp_path: Path) -> None:
    two = "stretch_1,stretch_2,stress_1_[MPa],stress_2_[MPa]\n1,1,0,0\n1.5,1,.2,.1\n2,1,.3,.2\n"
    (tmp_path / "rubber_uniaxial.csv").write_text(two + "2.5,1,.4,.3\n")
    with pytest.raises(RecordingError, match="two stretches in mode uniaxial"):
        load(Multimode(data=str(tmp_path)), tmp_path)
    one = "stretch,stress_[MPa]\n1,0\n1.5,.2\n2,.3\n2.5,.4\n"
    (tmp_path / "rubber_uniaxial.csv").write_text(one)
    (tmp_path / "rubber_uniaxial.txt").write_text(one)
    (tmp_path / "rubber_equibiaxial.csv").write_text(one)
    (tmp_path / "rubber_biaxial.csv").write_text(one)
    with pytest.raises(RecordingError, match=r"'rubber' has \[.*\]; one curve a mode"):
        load(Multimode(data=str(tmp_path)), tmp_path)
