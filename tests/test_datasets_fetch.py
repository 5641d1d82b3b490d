from __future__ import annotations

import bz2
import hashlib
import shutil
import socket
import threading
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from hsslam.datasets import catalogue
from hsslam.datasets.catalogue import HOMES, REAL, RealDataset, RemoteFile, open_dataset
from hsslam.datasets.fetch import fetch
from hsslam.errors import DataError

LINE = b"FLASER 3 1.0 2.0 81.83 0.1 0 0 0.1 0 0 %d.5 host 0\n"
LOG = bz2.compress(b"".join(LINE % i for i in range(100, 110)))
RELATIONS = b"100.5 103.5 0.1 0 0 0 0 0.2\n"


class Home:
    """A public home on this machine: what it serves, what it was asked for."""

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.requests: list[str] = []
        self.break_off = False
        home = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                home.requests.append(self.path)
                content = home.files.get(self.path)
                if content is None:
                    self.send_error(404)
                    return
                self.send_response(200)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content[: len(content) // 2] if home.break_off else content)

            def log_message(self, *_: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(
            target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True
        )

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.server_port}"

    @property
    def urls(self) -> dict[str, str]:
        return {"logs": f"{self.url}/logs/", "relations": f"{self.url}/relations"}


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Home]:
    for variable in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(variable, raising=False)
    small = RealDataset(
        replace(REAL["intel"].info, scan_count=10),
        (
            RemoteFile("intel.clf.bz2", "logs", hashlib.sha256(LOG).hexdigest()),
            RemoteFile("intel.relations", "relations", hashlib.sha256(RELATIONS).hexdigest()),
        ),
    )
    monkeypatch.setitem(catalogue.REAL, "intel", small)
    home = Home()
    home.files = {"/logs/intel.clf.bz2": LOG, "/relations/intel.relations": RELATIONS}
    home.thread.start()
    yield home
    home.server.shutdown()
    home.thread.join()
    home.server.server_close()


def test_fetch_downloads_checks_and_reports(
    home: Home, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    seen: list[tuple[str, int, int]] = []
    report = fetch("intel", tmp_path, progress=lambda *told: seen.append(told), base_urls=home.urls)
    assert home.requests == ["/logs/intel.clf.bz2", "/relations/intel.relations"]
    assert (tmp_path / "intel" / "intel.clf.bz2").read_bytes() == LOG
    assert [file.downloaded for file in report.files] == [True, True]
    assert report.scan_count == 10
    assert report.beams == {3: 10}
    assert report.duration == 9.0
    assert seen[-1] == ("intel.relations", len(RELATIONS), len(RELATIONS))
    assert ("intel.clf.bz2", len(LOG), len(LOG)) in seen
    text = str(report)
    assert "10 scans" in text and "3 beams" in text and "9 s" in text and "CC-BY 3.0" in text
    assert capfd.readouterr() == ("", "")
    dataset = open_dataset("intel", data_dir=tmp_path)
    assert sum(1 for _ in dataset.scans()) == 10
    relations = dataset.relations()
    assert relations is not None
    assert (relations.first.tolist(), relations.second.tolist()) == ([0], [3])


def test_what_is_there_is_not_fetched_again(home: Home, tmp_path: Path) -> None:
    fetch("intel", tmp_path, base_urls=home.urls)
    home.requests.clear()
    report = fetch("intel", tmp_path, base_urls=home.urls)
    assert home.requests == []
    assert [file.downloaded for file in report.files] == [False, False]
    assert "here already" in str(report)


def test_damaged_file_is_replaced(home: Home, tmp_path: Path) -> None:
    fetch("intel", tmp_path, base_urls=home.urls)
    home.requests.clear()
    (tmp_path / "intel" / "intel.relations").write_bytes(b"scribble")
    report = fetch("intel", tmp_path, base_urls=home.urls)
    assert home.requests == ["/relations/intel.relations"]
    assert [file.downloaded for file in report.files] == [False, True]
    assert (tmp_path / "intel" / "intel.relations").read_bytes() == RELATIONS


def failure(home: Home, folder: Path) -> str:
    with pytest.raises(DataError) as caught:
        fetch("intel", folder, base_urls=home.urls)
    message = str(caught.value)
    assert "\n" not in message
    assert f"hsslam datasets fetch intel --data-dir {folder}" in message
    assert not (folder / "intel" / "intel.clf.bz2").exists()
    assert not list((folder / "intel").glob("*")) if (folder / "intel").exists() else True
    return message


def test_wrong_checksum(home: Home, tmp_path: Path) -> None:
    home.files["/logs/intel.clf.bz2"] = LOG + b"more"
    message = failure(home, tmp_path)
    assert hashlib.sha256(LOG).hexdigest() in message
    assert home.url in message


def test_file_not_found_at_its_home(home: Home, tmp_path: Path) -> None:
    home.files.clear()
    assert "404 Not Found" in failure(home, tmp_path)


def test_connection_that_breaks_off(home: Home, tmp_path: Path) -> None:
    home.break_off = True
    assert "broke off" in failure(home, tmp_path)


def test_no_server(home: Home, tmp_path: Path) -> None:
    with (
        socket.socket() as taken
    ):  # bound but not listening: nobody answers there, and nobody else gets the port
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(DataError) as caught:
            fetch("intel", tmp_path, base_urls={"logs": f"http://127.0.0.1:{port}/"})
    assert "no connection to the server" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_folder_that_cannot_be_written(home: Home, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="cannot be downloaded to"):
        fetch("intel", tmp_path / "file", base_urls=home.urls)


def test_log_with_another_number_of_scans(
    home: Home, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = catalogue.REAL["intel"]
    monkeypatch.setitem(catalogue.REAL, "intel", replace(small, info=replace(small.info, scan_count=11)))
    with pytest.raises(DataError, match="expected 11 scans, found 10"):
        fetch("intel", tmp_path, base_urls=home.urls)


@pytest.mark.parametrize(("name", "reason"), [("office", "simulated"), ("intell", "did you mean 'intel'")])
def test_nothing_to_fetch(name: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=reason):
        fetch(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", sorted(REAL))
def test_sums_of_the_catalogue_are_those_of_the_public_files(
    name: str, shared_data: Path, tmp_path: Path
) -> None:
    # Nothing listens at these addresses: had a file another sum, the download would be tried and fail.
    nowhere = dict.fromkeys(HOMES, "http://127.0.0.1:9/")
    for file in REAL[name].files:
        (tmp_path / name).mkdir(exist_ok=True)
        shutil.copy(shared_data / name / file.name, tmp_path / name / file.name)
    report = fetch(name, tmp_path, base_urls=nowhere)
    assert report.scan_count == REAL[name].info.scan_count
    assert not any(file.downloaded for file in report.files)
