"""``piazzi data``: the table, and downloads from a server on this machine."""

import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

import pytest

from piazzi.earth import finding
from piazzi.earth.eop import tables
from tests.earth.test_space_weather import HEADER, OCTOBER_1957

WEATHER = f"{HEADER}\n{OCTOBER_1957}".encode()


@pytest.fixture(autouse=True)
def folders(tmp_path, monkeypatch):
    monkeypatch.setenv("PIAZZI_EARTH", str(tmp_path / "earth"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    monkeypatch.setattr(finding, "_given", [])
    monkeypatch.setenv("no_proxy", "*")
    tables.cache_clear()
    yield
    tables.cache_clear()


@pytest.fixture
def server():
    """Answers by path: what it has, half of it, or an error."""

    class Answers(BaseHTTPRequestHandler):
        def do_GET(self):
            name = self.path.strip("/")
            if name not in ("whole", "half", "other"):
                self.send_error(404, "Not Found")
                return
            body = WEATHER if name != "other" else b"<html>come back later</html>"
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body[: len(body) // 2] if name == "half" else body)

        def log_message(self, *arguments):
            pass

    here = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    thread = threading.Thread(target=here.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{here.server_port}"
    here.shutdown()
    thread.join()
    here.server_close()


def test_the_table_and_its_json(call, tmp_path):
    text = call("data")
    assert text.status == 0
    for word in ("eop", "leap seconds", "weather", "kernel", "stations", "field", str(tmp_path / "earth")):
        assert word in text.out
    document = call("data", "--json").document
    assert document["schema"] == "piazzi.data/1"
    assert document["folders"] == [str(tmp_path / "earth"), str(tmp_path / "share" / "piazzi")]
    assert [e["kind"] for e in document["data"]] == [
        "eop",
        "leap seconds",
        "weather",
        "kernel",
        "stations",
        "stations",
        "field",
    ]  # of the ILRS and the MPC
    assert set(document["data"][0]) == {"kind", "file", "last", "predicted", "cost", "address"}


def test_a_download_is_found_afterwards(call, server, tmp_path):
    result = call("data", "get", "weather", "--from", f"{server}/whole")
    path = tmp_path / "share" / "piazzi" / "SW-All.csv"
    assert result.status == 0 and str(path) in result.out
    assert path.read_bytes() == WEATHER
    entry = next(e for e in call("data", "--json").document["data"] if e["kind"] == "weather")
    assert (entry["file"], entry["last"]) == (str(path), "1957-10-05")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("half", "cut short"),
        ("other", "not what it should be: SW-All.csv: no space weather"),
        ("none", "answered 404 Not Found"),
    ],
)
def test_what_is_not_whole_or_not_right_changes_nothing(call, server, tmp_path, name, said):
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "SW-All.csv").write_bytes(b"old")
    assert said in call("data", "get", "weather", "--from", f"{server}/{name}", "--data", folder).refused()
    assert [p.name for p in folder.iterdir()] == ["SW-All.csv"]
    assert (folder / "SW-All.csv").read_bytes() == b"old"


def test_nobody_there(call, server, tmp_path):
    assert "refused" in call("data", "get", "weather", "--from", "http://127.0.0.1:1/x").refused()


@pytest.mark.parametrize("address", ["file:///etc/hostname", "ftp://x/y", "nonsense"])
def test_only_the_web_is_fetched(call, address):
    assert "only http and https are fetched" in call("data", "get", "weather", "--from", address).refused()


def test_a_kernel_that_ends_early_is_refused(tmp_path):
    path = tmp_path / "k.bsp"
    head = b"DAF/SPK " + bytes(76) + (1000).to_bytes(4, "little") + b"LTL-IEEE"
    path.write_bytes(head.ljust(1024, b"\0") + bytes(8 * 999 - 1024))
    finding.check_kernel(path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(ValueError, match=r"k\.bsp has 7,991 of at least 7,992 bytes"):
        finding.check_kernel(path)


def test_addresses_are_those_of_who_makes_the_data():
    from piazzi.earth.inventory import ADDRESSES

    assert ADDRESSES.keys() == {"eop", "weather", "kernel"}
    owners = ("iers.org", "celestrak.org", "nasa.gov")  # none is one of packages
    assert all(urlsplit(address).netloc.endswith(owners) for address in ADDRESSES.values())
