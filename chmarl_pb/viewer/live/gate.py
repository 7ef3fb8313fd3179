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
import threading
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, wait
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
_LAST_PORT = 65535
_GLANCE = 0.05  # seconds between two looks at whether the server has started
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
        try:
            return self._answer(request)
        except ValueError:  # no address, no origin, or not a text
            return _response(HTTPStatus.FORBIDDEN, _REFUSAL, {})

    def _answer(self, request: Request) -> Response | None:
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
        OptionError: the host is none of this machine's, the port is none or cannot be had, or this version of viser
            leaves no room for the gate.
    """
    _check_host(host)
    if not 0 <= port <= _LAST_PORT:
        raise OptionError(f"--port {port} is not a whole number from 0 to {_LAST_PORT}")
    with _watched(gate.answer) as threads, redirect_stdout(io.StringIO()):
        server = _started(host, port, threads)
    if not threads:
        stop(server)
        raise OptionError(
            f"viser {viser.__version__} makes its web server in another way than known, so that it cannot be guarded; "
            "install a version that the extra 'viewer' names"
        )
    return server


def _started(host: str, port: int, threads: list[threading.Thread]) -> viser.ViserServer:
    """Start a server beside this thread: viser waits for its web server for ever, also for one that has ended.

    Args:
        host: to listen on.
        port: the same.
        threads: gets that of each web server.

    Raises:
        OptionError: the web server has ended.
    """
    started: Future[viser.ViserServer] = Future()

    def start() -> None:
        try:
            started.set_result(viser.ViserServer(host, port, verbose=False))
        except BaseException as error:
            started.set_exception(error)

    with _last_words(threads) as errors:
        threading.Thread(target=start, daemon=True).start()
        while not wait([started], _GLANCE).done:
            if threads and not threads[-1].is_alive():
                reason = errors[-1] if errors else "neither it nor one of the next is free"
                raise OptionError(f"--port {port}: the page cannot be served there ({reason}); name another port")
    return started.result()


@contextmanager
def _last_words(threads: Collection[threading.Thread]) -> Iterator[list[BaseException]]:
    """Yield a list of the errors that end some threads, which are not printed then."""
    usual, errors = threading.excepthook, list[BaseException]()

    def hear(ended: threading.ExceptHookArgs) -> None:
        if ended.thread in threads and ended.exc_value is not None:
            errors.append(ended.exc_value)
        else:
            usual(ended)

    threading.excepthook = hear
    try:
        yield errors
    finally:
        threading.excepthook = usual


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
def _watched(answer: Callable[[Request], Response | None]) -> Iterator[list[threading.Thread]]:
    """Put a check in front of each web server that is made within; yield a list that gets the thread of each."""
    library: Any = websocket_server
    serve, threads = library.serve, list[threading.Thread]()
    quiet = logging.getLogger(__name__)
    quiet.setLevel(logging.CRITICAL)  # browsers drop connections as they like

    def guarded(*given: Any, process_request: _Check | None = None, **options: Any) -> Any:
        threads.append(threading.current_thread())

        def check(connection: Any, request: Request) -> Response | None:
            return answer(request) or (process_request(connection, request) if process_request else None)

        return serve(*given, **options, process_request=check, logger=quiet)

    library.serve = guarded
    try:
        yield threads
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
