"""Files come whole and checked or not at all; a server on loopback cuts, changes and refuses."""

import json
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from command_line import here, refused

from validate.commands import data as command
from validate.datasets import home
from validate.datasets.bring import bring, csv_of
from validate.datasets.home import DataFile, DataSet, cache_folder
from validate.errors import RecordingError

LOG, NOTE = b"0.0,1.0\n" * 40_000, b"as you like"


class Server(ThreadingHTTPServer):
    """Answers by path with (status, bytes said, bytes sent); counts what it was asked."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.answers: dict[str, tuple[int, int, bytes]] = {}
        self.asked: list[str] = []

    def holds(
        self, path: str, content: bytes, *, status: int = 200, said: int | None = None
    ) -> None:
        self.answers[f"/lab/logs/0123456/{path}"] = status, said or len(content), content

    @property
    def base(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Server)
        self.server.asked.append(self.path.rpartition("/")[2])
        status, said, content = self.server.answers.get(self.path, (404, 0, b""))
        self.send_response(status)
        self.send_header("Content-Length", str(said))
        self.end_headers()
        self.wfile.write(content)
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Server]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv(home.SHARED, str(tmp_path / "shared"))
    with Server() as found:
        monkeypatch.setattr(home, "RAW", found.base)
        serving = Thread(target=found.serve_forever, kwargs={"poll_interval": 0.01})
        serving.start()
        found.holds("raw/log.csv", LOG)
        found.holds("raw/LICENSE", NOTE)
        yield found
        found.shutdown()
        serving.join()


def file(name: str, content: bytes) -> DataFile:
    return DataFile(
        name, f"raw/{name.rpartition('/')[2]}", sha256(content).hexdigest(), len(content)
    )


@pytest.fixture
def logs(monkeypatch: pytest.MonkeyPatch) -> DataSet:
    files = (file("LICENSE", NOTE), file("first/log.csv", LOG))
    made = DataSet("logs", "force/logs", "logs", "lab/logs", "0123456", "MIT", "Lab (2026).", files)
    for module in (home, command):
        monkeypatch.setattr(module, "data_sets", lambda: (made,))
    monkeypatch.setattr(home, "data_set_of", lambda _: made)
    return made


def nothing(*_: object) -> None:
    pass


def kept() -> list[str]:
    return sorted(p.name for p in cache_folder().parent.rglob("*") if p.is_file())


def test_what_comes_is_whole_told_on_its_way_and_comes_once(server: Server, logs: DataSet) -> None:
    told: list[tuple[int, int, str]] = []
    assert bring(logs, lambda *said: told.append(said)) == logs.files
    folder = cache_folder() / "force/logs"
    assert (folder / "first/log.csv").read_bytes() == LOG
    assert (folder / "LICENSE").read_bytes() == NOTE
    total = len(LOG) + len(NOTE)
    assert told[0] == (0, total, "LICENSE")
    assert told[-1] == (total, total, "first/log.csv")
    assert [done for done, _, _ in told if 0 < done - len(NOTE) < len(LOG)]  # more than an end
    assert all(done <= total for done, _, _ in told)
    assert bring(logs, nothing) == ()
    assert server.asked == ["LICENSE", "log.csv"]
    assert kept() == ["LICENSE", "log.csv"]


def test_a_changed_file_is_not_kept_and_the_others_come(server: Server, logs: DataSet) -> None:
    server.holds("raw/LICENSE", b"as you dislike it"[: len(NOTE)])
    with pytest.raises(RecordingError) as caught:
        bring(logs, nothing)
    assert str(caught.value) == (
        f"1 of 2 files could not be downloaded: LICENSE: the file at "
        f"{server.base}/lab/logs/0123456/raw/"
        f"LICENSE is not the registered one (sha256 {logs.files[0].sha256[:12]}..., 11 bytes); "
        "the download is discarded"
    )
    assert kept() == ["log.csv"]


def test_a_cut_transfer_leaves_nothing_and_the_next_one_mends_it(
    server: Server, logs: DataSet
) -> None:
    server.holds("raw/log.csv", LOG[:200_000], said=len(LOG))
    with pytest.raises(RecordingError, match=r"log\.csv: the transfer from .* ended"):
        bring(logs, nothing)
    assert kept() == ["LICENSE"]
    server.holds("raw/log.csv", LOG)
    assert [f.name for f in bring(logs, nothing)] == ["first/log.csv"]
    assert kept() == ["LICENSE", "log.csv"]


def test_a_damaged_file_of_the_cache_is_brought_anew_and_stays_till_then(
    server: Server, logs: DataSet
) -> None:
    bring(logs, nothing)
    damaged = cache_folder() / "force/logs/first/log.csv"
    damaged.write_bytes(b"half")
    server.holds("raw/log.csv", LOG[:10], said=len(LOG))
    with pytest.raises(RecordingError, match="ended before"):
        bring(logs, nothing)
    assert damaged.read_bytes() == b"half"
    server.holds("raw/log.csv", LOG)
    bring(logs, nothing)
    assert damaged.read_bytes() == LOG


@pytest.mark.parametrize("status", [404, 503])
def test_a_server_that_refuses_is_one_line(server: Server, logs: DataSet, status: int) -> None:
    server.holds("raw/log.csv", b"no", status=status)
    with pytest.raises(RecordingError, match=rf"1 of 2 files .* first/log\.csv: {status}"):
        bring(logs, nothing)
    assert kept() == ["LICENSE"]


def test_without_a_network_the_command_says_so_in_one_line(
    server: Server, logs: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Server() as gone:
        nowhere = gone.base
    monkeypatch.setattr(home, "RAW", nowhere)
    line = refused("data", "get", "logs")
    assert "127.0.0.1" in line
    assert "cannot be reached; check the network and run the command again" in line
    assert kept() == []


def test_a_killed_transfer_is_swept_away_a_day_later(server: Server, logs: DataSet) -> None:
    import os

    transfers = cache_folder().parent / "transfers"
    for name, age in (("old", 2 * 86_400), ("running", 60)):
        (transfers / name).mkdir(parents=True)
        changed = (transfers / name).stat().st_mtime - age
        os.utime(transfers / name, (changed, changed))
    bring(logs, nothing)
    assert [p.name for p in transfers.iterdir()] == ["running"]


def test_the_command_brings_says_what_to_cite_and_knows_what_is_here(
    server: Server, logs: DataSet, tmp_path: Path
) -> None:
    code, out, _ = here("data", "get", "logs")
    assert code == 0
    assert "2 files downloaded, 0 already present" in out
    assert "licence MIT; cite: Lab (2026). https://github.com/lab/logs/tree/0123456" in out
    listed = json.loads(here("data", "--json")[1])[0]
    assert listed["here"] == str(cache_folder())
    assert listed["files"][0] == {
        "name": "LICENSE", "address": f"{server.base}/lab/logs/0123456/raw/LICENSE",
        "sha256": logs.files[0].sha256, "bytes": 11,
    }  # fmt: skip
    assert "is already here" in here("data", "get", "logs")[1]
    assert "logs" in here("data")[1]
    assert server.asked == ["LICENSE", "log.csv"]


PROGRAM = """
function pull()
    matrix = [
    1.0 0.00
    1.2345678912 -0.5
    ]
    return matrix
end # a comment
function planes(λ₁)
    @assert λ₁ ∈ [1.5, 2]
    if λ₁ == 1.5
        λ₂ = [0.9, 1.0]
        λ₁ = fill(λ₁, length(λ₂))
        s₁ = [0.10, 0.2]
        s₂ = [0.000, 0.3]
    elseif λ₁ == 2
        λ₂ = [1.250]
        λ₁ = fill(λ₁, length(λ₂))
        s₁ = [3]
        s₂ = [4]
    end
    return rows(s₁ .* 1e6, s₂, λ₁, λ₂)
end
"""


def test_rows_of_a_program_become_the_registered_file(
    server: Server, logs: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert csv_of(PROGRAM, "planes", "a,b,c,d") == (
        "a,b,c,d\n1.5,0.9,0.1,0\n1.5,1,0.2,0.3\n2,1.25,3,4\n"
    )
    assert csv_of(PROGRAM, "nothing", "a,b") == "a,b\n"
    content = b"x,y\n1,0\n1.23456789,-0.5\n"
    elsewhere = "/other/lab/9999999/data.jl"
    server.answers[elsewhere] = 200, len(PROGRAM.encode()), PROGRAM.encode()
    rows = DataFile("pull.csv", elsewhere, sha256(content).hexdigest(), len(content), "pull", "x,y")
    bring(replace(logs, files=(rows,)), nothing)
    assert (cache_folder() / "force/logs/pull.csv").read_bytes() == content
    wrong = replace(rows, name="other.csv", header="x,z")
    with pytest.raises(RecordingError, match=r"other\.csv.* is not the registered"):
        bring(replace(logs, files=(wrong,)), nothing)
    assert kept() == ["pull.csv"]


def test_what_was_made_by_hand_is_not_brought(
    server: Server, logs: DataSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    by_hand = replace(logs.files[0], source="")
    made = replace(logs, files=(by_hand,), made="the rows of data.jl")
    monkeypatch.setattr(home, "data_sets", lambda: (made,))
    line = refused("data", "get", "logs")
    assert "logs cannot be downloaded: the rows of data.jl" in line
    some = replace(logs, files=(by_hand, logs.files[1]), made="the rows of data.jl")
    monkeypatch.setattr(home, "data_sets", lambda: (some,))
    code, out, _ = here("data", "get", "logs")
    assert code == 0
    assert "1 files are not downloadable: the rows of data.jl" in out
