"""The page in a real browser, without a network: visible, whole, every picture decoded."""

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from report_samples import small_result
from tracking_samples import tracking_result

from validate.report.write import write_report

OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr", "--v=0",
)  # fmt: skip
# Added by the test only: the shipped page has no script. What it finds ends up in the DOM.
FINDINGS = """<script>addEventListener("load", () => {
  const shown = id => { const box = document.getElementById(id).getBoundingClientRect();
                        return box.width > 100 && box.height > 10; };
  const found = {pictures: [...document.images].map(i => i.naturalWidth),
                 verdict: shown("verdict"), title: document.querySelector("h1").innerText,
                 whys: [...document.querySelectorAll("tr.below div")]
                   .map(d => [d.getBoundingClientRect().left, d.getBoundingClientRect().right]),
                 verdicts: [...document.querySelectorAll("tr.parted td.good")]
                   .map(d => [d.getBoundingClientRect().left, d.getBoundingClientRect().right]),
                 wide: innerWidth, spilt: [...document.querySelectorAll("td, th")]
                   .filter(c => c.scrollWidth > c.clientWidth + 1).map(c => c.innerText),
                 anchors: [...document.querySelectorAll("nav a")]
                   .map(a => document.querySelectorAll(a.getAttribute("href")).length),
                 overflow: document.documentElement.scrollWidth - innerWidth};
  const pre = document.createElement("pre"); pre.id = "found";
  pre.textContent = JSON.stringify(found); document.body.append(pre); });</script></body>"""


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
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VALIDATE_NO_GL", "1")
        folder = tmp_path_factory.mktemp("browser") / "cube"
        return write_report(small_result(), folder, created="2026-11-21T04:00:00Z")


def run(browser: str, page: Path, profile: Path, *more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [browser, *OPTIONS, f"--user-data-dir={profile}", *more, page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )


def look(browser: str, page: Path, folder: Path, width: int = 1280) -> tuple[dict[str, Any], str]:
    """What `FINDINGS` found on a page, and the page's text; the console stays empty."""
    probe = folder / "probe.html"
    probe.write_text(page.read_text().replace("</body>", FINDINGS))
    done = run(browser, probe, folder / "profile", f"--window-size={width},1000", "--dump-dom")
    match = re.search(r'<pre id="found">(.*?)</pre>', done.stdout)
    assert match, done.stdout[-500:]
    assert "CONSOLE" not in done.stderr
    found: dict[str, Any] = json.loads(unescape(match.group(1)))
    return found, unescape(done.stdout)


def test_dom(browser: str, report: Path, tmp_path: Path) -> None:
    found, text = look(browser, report, tmp_path)
    assert found["title"] == "A cube <between> plates"
    assert found["verdict"] is True
    assert len(found["pictures"]) >= 3
    assert all(width > 300 for width in found["pictures"])
    assert found["overflow"] <= 0
    assert small_result().sentence in text


@pytest.mark.slow
@pytest.mark.parametrize("width", [1200, 400])
def test_why_a_check_ends_as_it_does_is_seen_without_scrolling(
    browser: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    result = small_result()
    check = replace(
        result.checks[0], why=f"|E| is 0.5 u_val; {12 * 'what would decide, '}and so on"
    )
    methods = (replace(result.methods[0], checks=(check,)), *result.methods[1:])
    folder = tmp_path / "long"
    page = write_report(replace(result, methods=methods), folder, created="2026-11-21T04:00:00Z")
    found, text = look(browser, page, tmp_path, width)
    assert found["overflow"] <= 0
    assert len(found["whys"]) == 2  # of the check, and of the identified value
    assert check.why in text
    for left, right in (*found["whys"], *found["verdicts"]):
        assert 0 <= left < right <= found["wide"]


@pytest.mark.slow
def test_dom_of_a_result_over_time(
    browser: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    page = write_report(tracking_result(), tmp_path / "box", created="2026-11-21T04:00:00Z")
    found, _ = look(browser, page, tmp_path)
    assert len(found["pictures"]) == 9  # checks, 3 charts, 2 maps, noise, body, registration
    assert all(width > 300 for width in found["pictures"])
    assert found["overflow"] <= 0
    assert found["spilt"] == []  # no text of a cell lies on the next one
    assert set(found["anchors"]) == {1}


def test_screenshot(browser: str, report: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    run(browser, report, tmp_path / "profile", "--window-size=1280,900", f"--screenshot={shot}")
    with Image.open(shot) as image:
        colours = image.convert("RGB").getcolors(1280 * 900) or []
    green = (226, 244, 238)  # the band of an agreeing verdict
    assert {c: n for n, c in colours}.get(green, 0) > 20_000
