"""The page in a real browser, without a network: seen, whole, and what its script makes of it."""

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene
from PIL import Image
from report_samples import CHECK, bare_result, section, small_result
from tracking_samples import tracking_result

from validate.compare.exhibit import Chart, Exhibit, ImageSeries, NumberTable, Series
from validate.compare.result import Result
from validate.library.comparison import scores_of_runs
from validate.pipeline.experiment.find import find
from validate.report.exhibits import draw_all
from validate.report.page.html import page
from validate.report.sections.verdicts import band
from validate.report.write import write_report
from validate.solve.types import Ending, Outcome
from validate.study.loose_page import write_loose
from validate.study.stored_runs.published_page import write_published
from validate.study.stored_runs.score_comparison import write_comparison
from validate.study.study_page import Findings, write_study

OPTIONS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND",
    "--enable-logging=stderr", "--v=0", "--virtual-time-budget=20000",
)  # fmt: skip
# Added by the test: what a reader does and sees. What it finds ends up in the DOM.
FINDINGS = """<script>addEventListener("load", async () => {
  const wait = ms => new Promise(done => setTimeout(done, ms));
  const shown = id => { const box = document.getElementById(id).getBoundingClientRect();
                        return box.width > 100 && box.height > 10; };
  const all = selector => [...document.querySelectorAll(selector)];
  const span = d => [d.getBoundingClientRect().left, d.getBoundingClientRect().right];
  for (const details of all("main details")) details.open = true;
  await wait(200);
  const found = {pictures: [...document.images].map(i => i.naturalWidth),
                 verdict: shown("verdict"), title: document.querySelector("h1").innerText,
                 whys: all("tr.below div").map(span),
                 verdicts: all("tr.parted td.good").map(span), wide: innerWidth,
                 spilt: all(".sortable td, .sortable th")
                   .filter(c => c.scrollWidth > c.clientWidth + 1).map(c => c.innerText),
                 anchors: all("nav a").map(a => all(a.getAttribute("href")).length),
                 links: all(".forest a").map(a => all(a.getAttribute("href")).length),
                 viewers: all(".viewer canvas").length, plots: all(".uplot canvas").length,
                 plotted: all("script.plot").length,
                 requests: performance.getEntriesByType("resource")
                   .map(e => e.name).filter(n => !n.startsWith("data:")),
                 overflow: document.documentElement.scrollWidth - innerWidth};
  await (async () => { ACTION })();
  const pre = document.createElement("pre"); pre.id = "found";
  pre.textContent = JSON.stringify(found); document.body.append(pre); });</script></body>"""
CREATED = "2026-11-21T04:00:00Z"
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def browser() -> str:
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
    found = next((p for n in names if (p := shutil.which(n))), None)
    if found is None:
        assert os.environ.get("VALIDATE_REQUIRE_BROWSER") != "1", "no chromium on PATH"
        pytest.skip("no chromium on PATH (VALIDATE_REQUIRE_BROWSER=1 makes this a failure)")
    return found


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("browser") / "cube"
    return write_report(small_result(), folder, created=CREATED)


def run(browser: str, page: Path, profile: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [browser, *OPTIONS, f"--user-data-dir={profile}", *more, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )


def look(
    browser: str, page: Path, folder: Path, width: int = 1280, action: str = "", *more: str
) -> tuple[dict[str, Any], str]:
    """What `FINDINGS` found on a page, and the page's text; nothing but the driver of a software
    renderer writes to the console."""
    probe = folder / "probe.html"
    text = page.read_text()
    before, _, behind = text.rpartition("</body>")
    probe.write_text(before + FINDINGS.replace("ACTION", action) + behind)
    size = f"--window-size={width},1000"
    done = run(browser, probe, folder / "profile", size, "--dump-dom", *more)
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert match, done.stdout[-500:]
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in console if "GL Driver Message" not in line] == []
    found: dict[str, Any] = json.loads(unescape(match.group(1)))
    return found, unescape(done.stdout)


def with_checks(count: int) -> Result:
    """The small result with so many checks, of which every third fails."""
    result = small_result()
    words = ("good enough", "undecided", "not good enough")
    checks = tuple(
        replace(CHECK, name=f"force.plate@{i + 2}mm", value=0.1 * i, acceptance=words[i % 3])
        for i in range(count)
    )
    first = replace(result.methods[0], checks=checks)
    return replace(result, methods=(first, *result.methods[1:]))


def empty() -> Result:
    return Result("nothing", "Nothing", "none", "Nothing was run.", (), (), (), (), (), ())


def of_runs(folder: Path) -> Path:
    """A page without a run of its own, as studies, comparisons and summaries write it."""
    rows = tuple((f"Run {i}", float(30 - i)) for i in range(30))
    table = NumberTable("rates", "Rates of runs", ("run", "rate / Hz"), rows)
    exhibit = Exhibit("runs", "Runs", ("Thirty of them.",), (table,))
    told = ("runs", "Stored runs", "this folder", "30 runs are stored.")
    return write_loose(told, (exhibit,), {"kind": "summary"}, folder, "Summary")


def ended(state: Ending, why: str) -> Result:
    """The small result whose checked method ended so at step 3."""
    result = bare_result()
    (method,) = result.methods
    run = replace(method.run, outcome=Outcome(state, 3, why))
    return replace(result, methods=(replace(method, runs=(run,)),))


def of_a_study(folder: Path) -> Path:
    experiment = find("hanging_bar", ROOT)
    rows = tuple((f"Cell {i}", 1.5 * i, 0.1 / (i + 1)) for i in range(12))
    cells = NumberTable("cells", "Every cell.", ("cell", "time / s", "error / mm"), rows)
    x = np.arange(12.0)
    chart = Chart(
        "front", "Error over time", "time / s", "error / mm", (Series("all", x, 1 / (x + 1)),)
    )
    exhibits = (Exhibit("cells", "Cells", (), (cells,), charts=(chart,)),)
    told = Findings("Trade: a bar", "12 cells.", exhibits, {"kind": "tradeoff"}, cells, quick=True)
    return write_study(experiment, told, folder)


def of_a_comparison(folder: Path) -> Path:
    runs = [folder.with_name(name) for name in ("one", "other")]
    for run, checks in zip(runs, (3, 4), strict=True):
        of(with_checks(checks))(run)
    found = scores_of_runs(runs, (), (), "change")
    return write_comparison(found, {}, folder)


def of_printed_figures(folder: Path) -> Path:
    content = json.loads((of(small_result())(folder / "cube").parent / "results.json").read_text())
    figures = {"title": "A cube", "holds": True, "checked": CREATED, **content}
    page = write_published(folder, [figures])
    assert page is not None
    return page


def of(result: Result) -> Callable[[Path], Path]:
    return lambda folder: write_report(result, folder, created=CREATED)


SLIDER = """const slider = document.querySelector(".viewer input[type=range]");
  const canvas = document.querySelector(".viewer canvas");
  const output = document.querySelector(".viewer output");
  found.there = [output.innerText, canvas.getAttribute("aria-label")];
  slider.value = "0"; slider.dispatchEvent(new Event("input"));
  found.then = [output.innerText, canvas.getAttribute("aria-label")];
  found.colours = [...document.querySelectorAll(".viewer option")].map(o => o.innerText);"""
BESIDE = """const [method, beside] = document.querySelectorAll(".viewer select");
  const names = () => [...document.querySelectorAll(".viewer .titles b")].map(b => b.innerText);
  const choose = (one, value) => { one.value = value; one.dispatchEvent(new Event("change")); };
  const offered = () => [...beside.options].filter(o => !o.disabled).map(o => o.innerText);
  found.alone = names(); found.offered = [offered()];
  choose(beside, "1"); found.two = names();
  choose(method, "1"); found.same = names(); found.offered.push(offered());"""
LINK = """for (const d of document.querySelectorAll("main details")) d.open = false;
  location.hash = "#recording"; await wait(50);
  found.open = [...document.querySelectorAll("main details[open] h2")].map(h => h.id);"""


@pytest.fixture(scope="module")
def looked(browser: str, report: Path) -> tuple[dict[str, Any], str]:
    """The report in one browser, which then moves the slider, shows two methods, follows a link."""
    one_by_one = " ".join(f"{{ {action} }}" for action in (SLIDER, BESIDE, LINK))
    return look(browser, report, report.parent.parent, 1280, one_by_one)


def test_dom(looked: tuple[dict[str, Any], str]) -> None:
    found, text = looked
    assert found["title"] == "A cube <between> plates"
    assert found["verdict"] is True
    assert len(found["pictures"]) >= 3
    assert all(width > 300 for width in found["pictures"])
    assert found["overflow"] <= 0
    assert found["requests"] == []
    assert found["viewers"] == 1
    assert found["plots"] == found["plotted"] > 0
    assert small_result().sentence in text


@pytest.mark.slow
@pytest.mark.parametrize("width", [375, 1280])
@pytest.mark.parametrize(
    "write",
    [of(with_checks(3)), of(bare_result()), of(ended("diverged", "u beyond 1 km")),
     of(ended("refused", "nu = 0.5")), of(empty()), of_runs, of_a_study, of_a_comparison,
     of_printed_figures, of(with_checks(500))],
    ids=["failing", "not converged", "diverged", "refused", "empty", "summary", "study",
         "comparison", "printed figures", "500 checks"],
)  # fmt: skip
def test_every_kind_of_page_is_whole(
    browser: str, tmp_path: Path, write: Callable[[Path], Path], width: int
) -> None:
    found, _ = look(browser, write(tmp_path / "report"), tmp_path, width)
    assert found["verdict"] is True
    assert found["overflow"] <= 0
    assert found["requests"] == []
    assert found["plots"] == found["plotted"]
    assert set(found["anchors"]) <= {1}
    assert set(found["links"]) <= {1}


def test_every_check_is_a_line() -> None:
    result = with_checks(500)
    text = page(result, draw_all(result, [section(result, "checks")]), CREATED, band(result))
    (lines,) = re.findall(r'<table class="forest">.*?<tbody>(.*?)</tbody>', text, re.DOTALL)
    assert lines.count("<tr") == 500


def test_the_slider_moves_the_body(looked: tuple[dict[str, Any], str]) -> None:
    found, _ = looked
    assert found["there"][0] == "2 mm"
    assert found["then"][0] == "0 mm"
    assert "at 0 mm" in found["then"][1]
    assert {"displacement / mm", "von Mises stress / Pa", "largest principal strain / %",
            "difference from stiff <cube> / mm"} <= set(found["colours"])  # fmt: skip


def test_two_methods_stand_side_by_side(looked: tuple[dict[str, Any], str]) -> None:
    found, _ = looked
    assert found["alone"] == found["same"] == []
    assert found["two"] == ["soft <cube>", "stiff <cube>"]
    assert found["offered"] == [["none", "stiff <cube>"], ["none", "soft <cube>"]]


# `picture` is what Save PNG gives; `choose` picks an option of a select by its label.
PICTURES = """let saved = "";
  HTMLAnchorElement.prototype.click = function () { saved = this.href; };
  const all = selector => [...document.querySelectorAll(selector)];
  const save = all(".viewer button").find(b => b.textContent === "Save PNG");
  const picture = () => { save.click(); return saved; };
  const tell = (one, kind) => one.dispatchEvent(new Event(kind));
  const set = (one, value) => { one.value = value; tell(one, "change"); tell(one, "input"); };
  const choose = (text, label) => { const found = all(".viewer option").find(o =>
      o.textContent === text && o.closest("label").textContent.startsWith(label));
    set(found.closest("select"), found.value); };
  const slider = document.querySelector(".viewer input[type=range]");"""


def two_bodies() -> Result:
    """The second method is pressed half as much again."""
    first, other = small_result().methods
    run = replace(other.run, u=1.5 * other.run.u)
    return replace(small_result(), methods=(first, replace(other, runs=(run, run))))


def opened_cavity() -> Result:
    """A body with a cavity, which begins opened."""
    scene = phantom_scene(phantom_mesh(COARSE_GRID))
    method = small_result().methods[0]
    u = np.zeros((2, len(scene.mesh.nodes), 3))
    u[1, :, 2] = 0.05 * scene.mesh.nodes[:, 0]
    run = replace(method.run, u=u)
    return replace(small_result(), methods=(replace(method, scene=scene, runs=(run, run)),))


@pytest.mark.slow
@pytest.mark.parametrize("result", [two_bodies, tracking_result, opened_cavity])
def test_every_control_changes_the_picture(
    browser: str, tmp_path: Path, result: Callable[[], Result]
) -> None:
    action = f"""{PICTURES}
      found.same = picture() === picture();
      found.idle = [];
      for (const one of all(".viewer select, .viewer input")) {{
        const before = picture(), value = one.value, box = one.type === "checkbox";
        const at = one.parentElement.textContent.startsWith("beside") ? 2 : 1;
        if (box) one.click(); else set(one, one === slider ? 0 : one.options[at].value);
        if (picture() === before) found.idle.push(one.parentElement.textContent);
        if (box) one.click(); else set(one, value);
      }}"""
    found, _ = look(browser, of(result())(tmp_path / "report"), tmp_path, 1280, action)
    assert found["same"] is True
    assert found["idle"] == []


@pytest.mark.slow
def test_tools_move_with_scaled_displacements(browser: str, report: Path, tmp_path: Path) -> None:
    """Displacements of nought are the body at rest, its plates with it."""
    action = f"""{PICTURES} choose("difference from stiff <cube> / mm", "Colour");
      const canvas = document.querySelector(".viewer canvas");
      const bare = () => {{ picture(); return canvas.toDataURL(); }};
      choose("none", "Displacements"); const still = bare(); // without the name of the instant
      choose("true", "Displacements"); found.moved = bare() !== still;
      set(slider, 0); found.rest = bare() === still;"""
    found, _ = look(browser, report, tmp_path, 1280, action)
    assert found["moved"] is True
    assert found["rest"] is True


@pytest.mark.slow
def test_still_pictures_open_for_print(browser: str, report: Path, tmp_path: Path) -> None:
    action = """const stills = document.querySelector(".stills"); found.closed = !stills.open;
      dispatchEvent(new Event("beforeprint")); found.open = stills.open;"""
    found, _ = look(browser, report, tmp_path, 1280, action)
    assert found["closed"] is found["open"] is True


# The rows of the last saved picture as means of their pixels, 0 (black) to 255.
ROWS = """const rows = async () => {
    const image = new Image(); image.src = picture(); await image.decode();
    const flat = document.createElement("canvas"), wide = image.width;
    flat.width = wide; flat.height = image.height;
    const pen = flat.getContext("2d"); pen.drawImage(image, 0, 0);
    const data = pen.getImageData(0, 0, wide, flat.height).data;
    return Array.from({length: flat.height}, (_, y) => { let sum = 0;
      for (let i = 4 * y * wide; i < 4 * (y + 1) * wide; i++) sum += i % 4 < 3 ? data[i] : 0;
      return sum / (3 * wide); }); };"""


@pytest.mark.slow
def test_a_body_that_is_seen_through_is_paler(browser: str, report: Path, tmp_path: Path) -> None:
    action = f"""{PICTURES} {ROWS} const mean = a => a.reduce((x, y) => x + y) / a.length;
      const box = all(".viewer input[type=checkbox]").find(b =>
        b.parentElement.textContent.includes("see through"));
      found.whole = mean(await rows()); box.click(); found.through = mean(await rows());"""
    found, _ = look(browser, report, tmp_path, 1280, action)
    assert found["whole"] + 5 < found["through"] < 250


@pytest.mark.slow
def test_a_saved_picture_names_what_it_shows(browser: str, report: Path, tmp_path: Path) -> None:
    action = f"""{PICTURES} {ROWS} const canvas = document.querySelector(".viewer canvas");
      const one = await rows(); choose("stiff <cube>", "beside"); const two = await rows();
      found.more = one.length - canvas.height; const dark = a => a.reduce((x, y) => x + 255 - y, 0);
      const room = found.more / 2; found.tops = [one, two].map(a => dark(a.slice(0, room)));
      found.below = dark(one.slice(-room));"""
    found, _ = look(browser, report, tmp_path, 1280, action)
    assert found["more"] > 10
    assert 0 < found["tops"][0] < 0.8 * found["tops"][1]  # one name, two names
    assert found["below"] > 0


@pytest.mark.slow
def test_the_body_is_saved_on_white_from_a_dark_page(
    browser: str, report: Path, tmp_path: Path
) -> None:
    action = f"""{PICTURES} {ROWS} const canvas = document.querySelector(".viewer canvas");
      URL.createObjectURL = blob => {{ found.blob = blob; return "#"; }};
      all(".viewer button").find(b => b.textContent === "Save SVG").click();
      found.text = await found.blob.text(); delete found.blob;
      const whole = await rows(), room = (whole.length - canvas.height) / 2;
      found.white = Math.max(...whole.slice(room, -room)); // of the picture between its words
      const pen = document.createElement("canvas").getContext("2d");
      tell(window, "resize"); picture(); pen.drawImage(canvas, 0, 0);
      found.corner = [...pen.getImageData(0, 0, 1, 1).data];"""
    dark = "--blink-settings=preferredColorScheme=0"
    found, _ = look(browser, report, tmp_path, 1280, action, dark)
    top = ElementTree.fromstring(found["text"])
    (image,) = top.iter("{http://www.w3.org/2000/svg}image")
    assert image.get("href", "").startswith("data:image/png;base64,")
    words = [one.text or "" for one in top.iter("{http://www.w3.org/2000/svg}text")]
    assert words[0] == "soft <cube>"
    assert "2 mm; displacement / mm: 0 to " in words[1]
    assert found["white"] == 255
    assert max(found["corner"][:3]) < 230  # of the page itself


@pytest.mark.slow
def test_images_have_a_slider_and_are_all_there_without_scripts(
    browser: str, tmp_path: Path
) -> None:
    shades = tuple(np.full((40, 300 + i, 3), 80 * i, np.uint8) for i in range(3))
    series = ImageSeries("b_mode", "Images", "Three images", shades, ("0 mm", "1 mm", "2 mm"))
    own = Exhibit("images", "Images", pictures=(series,))
    page = of(replace(small_result(), exhibits=(own,)))(tmp_path / "report")
    action = """const figure = document.getElementById("figure-b_mode");
      const seen = () => [...figure.querySelectorAll("img")].filter(i => i.offsetWidth)
        .map(i => i.naturalWidth);
      const slider = figure.querySelector("input[type=range]");
      const output = figure.querySelector("output");
      found.first = slider && [seen(), output.textContent]; found.all = seen();
      if (slider) { slider.value = "0"; slider.dispatchEvent(new Event("input"));
        found.then = [seen(), output.textContent]; }"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    assert found["first"] == [[302], "2 mm"]
    assert found["then"] == [[300], "0 mm"]
    bare = tmp_path / "bare.html"
    bare.write_text(re.sub(r"<script(?! type).*?</script>", "", page.read_text(), flags=re.S))
    found, _ = look(browser, bare, tmp_path, 1280, action)
    assert found["all"] == [300, 301, 302]


@pytest.mark.slow
def test_zeros_on_a_logarithmic_axis_are_gaps(browser: str, tmp_path: Path) -> None:
    x = np.arange(4.0)
    series = (Series("falls", x, np.array([10.0, 1.0, 0.0, -1.0])), Series("none", x, 0 * x),
              Series("tiny", x, np.full(4, 4e-66)))  # 67 decades stop uPlot  # fmt: skip
    chart = Chart("logs", "Logarithmic", "t / s", "error / mm", series, log="y")
    page = of(replace(small_result(), exhibits=(Exhibit("l", "L", charts=(chart,)),)))(
        tmp_path / "r"
    )
    action = """const figure = document.getElementById("figure-chart_logs");
      found.ticks = figure.querySelectorAll(".uplot canvas").length;
      const canvas = figure.querySelector("canvas"), pen = canvas.getContext("2d");
      const pixels = pen.getImageData(0, 0, canvas.width, canvas.height).data;
      found.drawn = 0;
      for (let i = 0; i < pixels.length; i += 4) {
        if (pixels[i + 3] > 99 && pixels[i + 2] - pixels[i] > 60) found.drawn += 1;
      }"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    assert found["ticks"] == 1
    assert found["drawn"] > 100  # blue: the part above nought


@pytest.mark.slow
def test_a_curve_is_saved_as_vectors_as_it_is_shown(browser: str, tmp_path: Path) -> None:
    x = np.arange(4.0)
    line, hidden = Series("a <line>", x, 2 * x), Series("hidden", x, 3 - x)
    dots = Series("dots", x, x + 1, style="points")
    band = Series("band", x, x - 0.5, style="band", upper=x + 0.5)
    chart = Chart("saved", "Saved", "time / s", "force / N", (line, hidden, dots, band))
    page = of(replace(small_result(), exhibits=(Exhibit("s", "S", charts=(chart,)),)))(
        tmp_path / "r"
    )
    action = """const figure = document.getElementById("figure-chart_saved");
      URL.createObjectURL = blob => { found.blob = blob; return "#"; };
      HTMLAnchorElement.prototype.click = function () { found.file = this.download; };
      const rows = [...figure.querySelectorAll(".u-series")];
      rows.find(r => r.innerText.includes("hidden")).querySelector("th").click(); await wait(50);
      figure.querySelector("button").click();
      found.text = await found.blob.text(); found.kind = found.blob.type; delete found.blob;"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    assert (found["file"], found["kind"]) == ("figure-chart_saved.svg", "image/svg+xml")
    top = ElementTree.fromstring(found["text"])
    drawn = {kind: list(top.iter(f"{{http://www.w3.org/2000/svg}}{kind}"))
             for kind in ("polyline", "circle", "polygon", "text")}  # fmt: skip
    lengths = [len(drawn[kind]) for kind in ("polyline", "circle", "polygon")]
    assert lengths == [1, 4 + 1, 1]  # and the sign of the legend
    words = [one.text or "" for one in drawn["text"]]
    assert {"time / s", "force / N", "a <line>", "dots", "band"} <= set(words)
    assert not any("hidden" in text for text in words)
    points = np.array([p.split(",") for p in drawn["polyline"][0].get("points", "").split()], float)
    frame = next(r for r in top.iter("{http://www.w3.org/2000/svg}rect") if r.get("stroke"))
    low = np.array([float(frame.get(name, "nan")) for name in ("x", "y")])
    size = np.array([float(frame.get(name, "nan")) for name in ("width", "height")])
    assert ((points >= low - 1) & (points <= low + size + 1)).all()
    slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
    assert (slopes < 0).all()  # y rises upward on paper
    assert np.ptp(slopes) == pytest.approx(0, abs=0.01)


@pytest.mark.slow
def test_checks_and_pictures_are_saved_too(browser: str, tmp_path: Path) -> None:
    page = of(with_checks(3))(tmp_path / "r")
    action = """const files = [], texts = [];
      URL.createObjectURL = blob => { texts.push(blob.text()); return "#"; };
      HTMLAnchorElement.prototype.click = function () { files.push(this.download); };
      for (const d of document.querySelectorAll("details")) d.open = true;
      for (const b of document.querySelectorAll("figure > .note button")) b.click();
      found.files = files; found.texts = await Promise.all(texts);"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    drawings = dict(zip(found["files"], map(ElementTree.fromstring, found["texts"]), strict=True))
    checks = drawings.pop("figure-intervals_limits.svg")
    svg = "{http://www.w3.org/2000/svg}"
    words = [one.text or "" for one in checks.iter(f"{svg}text")]
    assert sum("force.plate@" in text for text in words) == 3
    assert sum(text.endswith("good enough") for text in words) == 2
    dots = [float(one.get("cx", "nan")) for one in checks.iter(f"{svg}circle")]
    assert len(set(dots)) == 3
    assert drawings
    for drawing in drawings.values():
        (image,) = drawing.iter(f"{svg}image")
        assert image.get("href", "").startswith("data:image/")
        assert float(image.get("width", 0)) > 100


@pytest.mark.slow
def test_a_logarithmic_axis_has_some_powers_of_ten(browser: str, tmp_path: Path) -> None:
    x = np.geomspace(1.0, 50.0, 30)
    chart = Chart("logs", "L", "t / s", "error / mm", (Series("a", x, 1e-7 * x**4),), log="xy")
    page = of(replace(small_result(), exhibits=(Exhibit("l", "L", charts=(chart,)),)))(
        tmp_path / "r"
    )
    action = """const figure = document.getElementById("figure-chart_logs");
      URL.createObjectURL = blob => { found.blob = blob; return "#"; };
      HTMLAnchorElement.prototype.click = () => {};
      figure.querySelector("button").click();
      found.text = await found.blob.text(); delete found.blob;"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    words = [one.text for one in ElementTree.fromstring(found["text"]).iter() if one.text]
    assert {"1e\u22126", "1e\u22124", "0.01", "1", "10"} <= set(words)
    assert "2e\u22127" not in words


@pytest.mark.slow
def test_all_ways_of_a_curve_are_hidden_together(browser: str, tmp_path: Path) -> None:
    x = np.array([0.0, 1.0, 2.0, 1.0, 0.0])
    chart = Chart("ways", "To and fro", "x / mm", "y / N", (Series("pressed", x, x + 1),))
    own = Exhibit("ways", "Ways", charts=(chart,))
    page = of(replace(small_result(), exhibits=(own,)))(tmp_path / "report")
    action = """const figure = document.getElementById("figure-chart_ways");
      const rows = [...figure.querySelectorAll(".u-series")].slice(1);
      found.shown = rows.map(r => getComputedStyle(r).display !== "none");
      rows[0].querySelector(".u-label").parentElement.click(); await wait(50);
      found.off = rows.map(r => r.classList.contains("u-off"));"""
    found, _ = look(browser, page, tmp_path, 1280, action)
    assert found["shown"] == [True, False]  # one name in the legend
    assert found["off"] == [True, True]


def test_a_table_sorts_filters_and_unfolds(browser: str, tmp_path: Path) -> None:
    action = """const table = document.querySelector("table.sortable");
      const names = () => [...table.tBodies[0].rows].filter(r => getComputedStyle(r).display
        !== "none").map(r => r.cells[0].innerText);
      found.first = names();
      table.tHead.rows[0].cells[1].click(); await wait(50); found.down = names();
      const key = new KeyboardEvent("keydown", {key: "Enter", bubbles: true});
      table.tHead.rows[0].cells[1].dispatchEvent(key); await wait(50); found.up = names();
      const field = document.querySelector(".filter");
      field.value = "RUN 2"; field.dispatchEvent(new Event("input")); found.filtered = names();"""
    found, _ = look(browser, of_runs(tmp_path / "runs"), tmp_path, 1280, action)
    assert found["first"] == [f"Run {i}" for i in range(8)]
    assert sorted((found["down"], found["up"])) == [
        [f"Run {i}" for i in range(8)], [f"Run {i}" for i in range(29, 21, -1)]
    ]  # fmt: skip
    assert set(found["filtered"]) == {f"Run {i}" for i in (2, *range(20, 30))}


@pytest.mark.slow
def test_rows_keep_their_words_when_they_are_sorted(browser: str, tmp_path: Path) -> None:
    action = """const table = document.querySelector("table.parted-rows");
      const pairs = () => [...table.querySelectorAll("tr.parted")].map(r =>
        [r.cells[1].innerText, r.nextElementSibling.innerText]);
      found.before = pairs();
      table.tHead.rows[0].cells[4].click(); await wait(50); found.after = pairs();"""
    result = with_checks(12)
    told = tuple(replace(c, why=f"why of {c.name}") for c in result.checks)
    first = replace(result.methods[0], checks=told)
    page = of(replace(result, methods=(first, *result.methods[1:])))(tmp_path / "report")
    found, _ = look(browser, page, tmp_path, 1280, action)
    assert found["before"] != found["after"]
    assert sorted(found["before"]) == sorted(found["after"])
    assert all(why == f"why of {name}" for name, why in found["after"])


def test_a_link_opens_its_section(looked: tuple[dict[str, Any], str]) -> None:
    found, _ = looked
    assert found["open"] == ["recording"]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_no_serious_barrier(browser: str, report: Path, tmp_path: Path, scheme: str) -> None:
    axe = files("axe_core_python").joinpath("axe.min.js").read_text("utf-8")
    page = tmp_path / "with_axe.html"
    page.write_text(report.read_text().replace("</body>", f"<script>{axe}</script></body>"))
    action = """found.dark = matchMedia("(prefers-color-scheme: dark)").matches;
      for (const one of document.querySelectorAll("details")) one.open = true;
      await wait(200);
      const told = await axe.run({resultTypes: ["violations"]});
      found.barriers = told.violations.filter(v => ["serious", "critical"].includes(v.impact))
        .map(v => [v.id, v.nodes.map(n => n.html.slice(0, 120))]);"""
    dark = ("--blink-settings=preferredColorScheme=0",) if scheme == "dark" else ()
    found, _ = look(browser, page, tmp_path, 1280, action, *dark)
    assert found["dark"] is (scheme == "dark")
    assert found["barriers"] == []


@pytest.mark.slow
def test_without_scripts_every_picture_and_row_is_there(
    browser: str, report: Path, tmp_path: Path
) -> None:
    bare = tmp_path / "bare.html"
    bare.write_text(re.sub(r"<script(?! type).*?</script>", "", report.read_text(), flags=re.S))
    found, _ = look(browser, bare, tmp_path)
    assert found["viewers"] == found["plots"] == 0
    assert all(width > 300 for width in found["pictures"])
    assert found["overflow"] <= 0


@pytest.mark.slow
@pytest.mark.parametrize("width", [1200, 400])
def test_why_a_check_ends_as_it_does_is_seen_without_scrolling(
    browser: str, tmp_path: Path, width: int
) -> None:
    result = small_result()
    check = replace(
        result.checks[0], why=f"|E| is 0.5 u_val; {12 * 'what would decide, '}and so on"
    )
    methods = (replace(result.methods[0], checks=(check,)), *result.methods[1:])
    page = of(replace(result, methods=methods))(tmp_path / "long")
    found, text = look(browser, page, tmp_path, width)
    assert found["overflow"] <= 0
    assert len(found["whys"]) == 2  # of the check, and of the identified value
    assert check.why in text
    for left, right in (*found["whys"], *found["verdicts"]):
        assert 0 <= left < right <= found["wide"]


@pytest.mark.slow
def test_dom_of_a_result_over_time(browser: str, tmp_path: Path) -> None:
    found, _ = look(browser, of(tracking_result())(tmp_path / "box"), tmp_path)
    assert len(found["pictures"]) == 8  # 3 charts, 2 maps, noise, body, registration
    assert all(width > 300 for width in found["pictures"])
    assert found["overflow"] <= 0
    assert found["spilt"] == []  # no text of a cell lies on the next one
    assert set(found["anchors"]) == {1}


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_figures")
@pytest.mark.parametrize("name", ["passing", "failing", "empty"])
def test_the_first_screen_is_the_stored_one(browser: str, tmp_path: Path, name: str) -> None:
    """In 160 x 112 pixels; VALIDATE_STORE_SCREENS=1 stores what is seen now."""
    result = {"passing": small_result(), "failing": failing(), "empty": empty()}[name]
    shot, page = tmp_path / "shot.png", of(result)(tmp_path / "report")
    size = "--window-size=1280,896"
    run(browser, page, tmp_path / "profile", size, f"--screenshot={shot}")
    with Image.open(shot) as image:
        seen = image.convert("RGB").resize((160, 112), Image.Resampling.BOX)
    stored = Path(__file__).parent / "screens" / f"{name}.png"
    if os.environ.get("VALIDATE_STORE_SCREENS") == "1":
        seen.save(stored, optimize=True)
    with Image.open(stored) as image:
        apart = np.asarray(seen, dtype=float) - np.asarray(image.convert("RGB"), dtype=float)
    # Letters of another font move by a pixel or two; a part that is missing, or a verdict of
    # another colour, changes a twentieth of the page.
    assert (np.abs(apart).max(axis=2) > 20).mean() < 0.03


def failing() -> Result:
    """Its requirement is not met."""
    result = small_result()
    bad = replace(CHECK, value=0.8, acceptance="not good enough", validation="differs")
    return replace(result, methods=(replace(result.methods[0], checks=(bad,)), result.methods[1]))


@pytest.mark.slow
def test_screenshot(browser: str, report: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    run(browser, report, tmp_path / "profile", "--window-size=1280,900", f"--screenshot={shot}")
    with Image.open(shot) as image:
        colours = image.convert("RGB").getcolors(1280 * 900) or []
    green = (220, 242, 234)  # the band of an agreeing verdict
    assert {c: n for n, c in colours}.get(green, 0) > 20_000


@pytest.mark.slow
def test_a_print_has_few_pages(browser: str, tmp_path: Path) -> None:
    page, paper = of(with_checks(500))(tmp_path / "report"), tmp_path / "paper.pdf"
    run(browser, page, tmp_path / "profile", f"--print-to-pdf={paper}", "--no-pdf-header-footer")
    assert 1 <= paper.read_bytes().count(b"/Type /Page\n") <= 12


@pytest.mark.slow
def test_what_turns_is_the_body(browser: str, report: Path, tmp_path: Path) -> None:
    """The view's first picture shows colours of the displacement where the body is."""
    shot = tmp_path / "shot.png"
    run(browser, report, tmp_path / "profile", "--window-size=1280,900", f"--screenshot={shot}")
    with Image.open(shot) as image:
        part = image.convert("RGB").crop((40, 150, 620, 520)).resize((58, 37))
    pixels = list(part.get_flattened_data())
    coloured = [p for p in pixels if max(p) - min(p) > 60]
    assert len(coloured) > 0.05 * len(pixels)
