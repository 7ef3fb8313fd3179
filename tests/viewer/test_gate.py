"""The gate: only who brings the token gets the page or the connection behind it."""

import http.client
import re
from collections.abc import Iterator
from typing import Any

import pytest

from chmarl_pb.errors import OptionError

viser = pytest.importorskip("viser", reason="the extra 'viewer' is not installed")
client = pytest.importorskip("websockets.sync.client")
exceptions = pytest.importorskip("websockets.exceptions")
gates = pytest.importorskip("chmarl_pb.viewer.live.gate")

PROTOCOL = [f"viser-v{viser.__version__}"]
Served = tuple[Any, Any]  # gate and server


@pytest.fixture(scope="module")
def served() -> Iterator[Served]:
    gate = gates.Gate()
    server = gates.guarded_server(gate, "127.0.0.1", 0)
    yield gate, server
    gates.stop(server)


def get(served: Served, path: str, **headers: str) -> http.client.HTTPResponse:
    connection = http.client.HTTPConnection("127.0.0.1", served[1].get_port(), timeout=30)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    return connection.getresponse()


def cookie_of(served: Served) -> str:
    answer = get(served, f"/?token={served[0].token}")
    assert (answer.status, answer.headers["Location"]) == (303, "/")
    given = answer.headers["Set-Cookie"]
    assert "HttpOnly" in given and "SameSite=Lax" in given
    return given.partition(";")[0]


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/index.html", "/?token=%C3%A4"])
def test_nothing_is_served_without_the_token(served: Served, path: str) -> None:
    answer = get(served, path)
    assert answer.status == 403
    assert b"chmarl-pb play" in answer.read()


@pytest.mark.parametrize("path", ["//[", "/?token=["])
def test_what_is_no_address_is_refused(served: Served, path: str) -> None:
    assert get(served, path).status == 403


def test_what_is_no_origin_or_no_text_is_refused(served: Served) -> None:
    cookie = cookie_of(served)
    assert get(served, "/", Cookie=cookie, Origin="http://[").status == 403
    name = cookie.partition("=")[0]
    assert get(served, "/", Cookie=f"{name}=\xff").status == 403


def test_token_leads_to_the_page(served: Served) -> None:
    cookie = cookie_of(served)
    assert get(served, "/", Cookie=f"other=1; {cookie}").status == 200
    assert get(served, "/", Cookie=cookie + "x").status == 403
    assert get(served, "/", Cookie=re.sub("=.*", "=", cookie)).status == 403


def test_connection_needs_the_cookie_and_the_own_origin(served: Served) -> None:
    port, cookie = served[1].get_port(), {"Cookie": cookie_of(served)}
    address = f"ws://127.0.0.1:{port}"
    with client.connect(address, subprotocols=PROTOCOL, additional_headers=cookie, compression=None) as own:
        assert own.recv(timeout=30)
    for headers, origin in (({}, None), (cookie, f"http://127.0.0.1:{port + 1}"), (cookie, "null")):
        with pytest.raises(exceptions.InvalidStatus, match="403"):
            client.connect(address, subprotocols=PROTOCOL, additional_headers=headers, origin=origin)


def test_every_gate_has_a_token_of_its_own() -> None:
    assert gates.Gate().token != gates.Gate().token
    assert len(gates.Gate().token) >= 32


def test_unknown_host_is_named() -> None:
    with pytest.raises(OptionError, match=r"--host 192\.0\.2\.1"):
        gates.guarded_server(gates.Gate(), "192.0.2.1", 0)


def test_a_server_that_ends_at_once_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("no more sockets")

    monkeypatch.setattr(gates.websocket_server, "serve", fail)
    with pytest.raises(OptionError, match=r"--port 8017: .*no more sockets"):
        gates.guarded_server(gates.Gate(), "127.0.0.1", 8017)
    assert capfd.readouterr() == ("", "")


def test_without_a_free_port_there_is_no_server(monkeypatch: pytest.MonkeyPatch) -> None:
    def taken(*_: Any, **__: Any) -> None:
        raise OSError("in use")

    monkeypatch.setattr(gates.websocket_server, "serve", taken)
    with pytest.raises(OptionError, match="neither it nor one of the next is free"):
        gates.guarded_server(gates.Gate(), "127.0.0.1", 8017)


def test_a_viser_that_cannot_be_guarded_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    class Elsewhere:
        serve = None

    monkeypatch.setattr(gates, "websocket_server", Elsewhere)
    with pytest.raises(OptionError, match="cannot be guarded"):
        gates.guarded_server(gates.Gate(), "127.0.0.1", 0)
