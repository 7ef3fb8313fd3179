"""The gate: a viser server that answers only those who bring its token.

viser itself lets everybody in. So its web server is made with a check in front: every request, for the page and for the
connection that follows, is looked at before viser sees it. The address with the token sets a cookie and leads on to the
address without it. Without the cookie nothing is served; nor to pages of other origins, which a browser would lend it.

That keeps out other users of the machine and pages of other sites. It does not hide what goes over a network: there is
no encryption.
"""

import hashlib
import hmac
import io
import logging
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

from chmarl_pb.errors import OptionError
from chmarl_pb.extras import needs

with needs("chmarl-pb play", "viewer"):
    import viser
    from websockets.asyncio import server as websocket_server
    from websockets.datastructures import Headers
    from websockets.http11 import Request, Response

_REFUSAL = "This address needs the token of the one that `chmarl-pb play` has printed.\n"
_Check = Callable[[Any, Request], Response | None]


class Gate:
    """Decides who may come in.

    Attributes:
        token: what they bring, in the address.
    """

    def __init__(self) -> None:
        """Draw a token."""
        self.token = secrets.token_urlsafe(24)
        self._cookie = f"chmarl_play_{hashlib.sha256(self.token.encode()).hexdigest()[:8]}"  # cookies know no ports

    def answer(self, request: Request) -> Response | None:
        """Return the answer to a request that goes no further; None lets it in."""
        query = parse_qs(urlsplit(request.path).query)
        if any(map(self._fits, query.get("token", ()))):
            cookie = f"{self._cookie}={self.token}; HttpOnly; SameSite=Lax; Path=/"
            return _response(HTTPStatus.SEE_OTHER, "", {"Location": "/", "Set-Cookie": cookie})
        if self._has_cookie(request.headers) and _is_own_page(request.headers):
            return None
        return _response(HTTPStatus.FORBIDDEN, _REFUSAL, {})

    def _has_cookie(self, headers: Headers) -> bool:
        pairs = [pair.strip().partition("=") for line in headers.get_all("Cookie") for pair in line.split(";")]
        return any(name == self._cookie and self._fits(value) for name, _, value in pairs)

    def _fits(self, value: str) -> bool:
        return hmac.compare_digest(value.encode(), self.token.encode())


def guarded_server(gate: Gate, host: str, port: int) -> viser.ViserServer:
    """Return a running viser server behind a gate; if the port is taken, it has one of the next.

    Args:
        gate: who may come in.
        host: name or address to listen on.
        port: to listen on; 0: any that is free.

    Raises:
        OptionError: the host is none of this machine's, or this version of viser leaves no room for the gate.
    """
    _check_host(host)
    with _watched(gate.answer) as made, redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host, port, verbose=False)
    if not made:
        stop(server)
        raise OptionError(
            f"viser {viser.__version__} makes its web server in another way than known, so that it cannot be guarded; "
            "install a version that the extra 'viewer' names"
        )
    return server


def stop(server: viser.ViserServer) -> None:
    """Stop a server without its word about it."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def _check_host(host: str) -> None:
    """Find out before viser does, which would try for ever."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as trial:
            trial.bind(address)
    except OSError as error:
        raise OptionError(f"--host {host}: {error.strerror or error}; name an address of this machine") from error


@contextmanager
def _watched(answer: Callable[[Request], Response | None]) -> Iterator[list[None]]:
    """Put a check in front of each web server that is made within; yield a list that has one item for each."""
    library: Any = websocket_server
    serve, made = library.serve, list[None]()
    quiet = logging.getLogger(__name__)
    quiet.setLevel(logging.CRITICAL)  # browsers drop connections as they like

    def guarded(*given: Any, process_request: _Check | None = None, **options: Any) -> Any:
        made.append(None)

        def check(connection: Any, request: Request) -> Response | None:
            return answer(request) or (process_request(connection, request) if process_request else None)

        return serve(*given, **options, process_request=check, logger=quiet)

    library.serve = guarded
    try:
        yield made
    finally:
        library.serve = serve


def _is_own_page(headers: Headers) -> bool:
    """Return whether a request comes from a page of this server, or from none, as one that a person opens."""
    origins, hosts = headers.get_all("Origin"), headers.get_all("Host")
    return all([urlsplit(origin).netloc] == hosts for origin in origins)


def _response(status: HTTPStatus, text: str, headers: dict[str, str]) -> Response:
    body = text.encode()
    known = {
        "Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body)), "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer", "Connection": "close",
    }  # fmt: skip
    return Response(status.value, status.phrase, Headers(known | headers), body)
