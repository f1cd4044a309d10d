"""The web server of the page, which only pages of its own may talk to."""

from __future__ import annotations

import http
import ipaddress
import socket
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server

LOOPBACK = "localhost"
ANY = ("0.0.0.0", "::")


def is_own_page(origin: str, host: str, names: Collection[str]) -> bool:
    """Tell whether a page that opens a websocket was served by the server that it connects to.

    A name that somebody else's DNS leads here (rebinding) is none of the server's, so that to have
    the same name in both is not enough.

    Parameters
    ----------
    origin, host
        The headers ``Origin`` and ``Host`` of the request; empty where there is none.
    names
        Of this server, beside ``localhost`` and addresses in numbers.
    """
    try:
        page = urlsplit(origin)
        name = page.hostname
    except ValueError:
        return False
    if page.scheme not in ("http", "https") or not name or page.netloc != host:
        return False
    return name in (LOOPBACK, *names) or _is_address(name)


class WebServer(viser.ViserServer):
    """A server of viser that refuses foreign origins, and is never shared through another one.

    Parameters
    ----------
    host, port
        Address to listen at; port 0: any that is free.
    names
        By which browsers may call this server, beside the machine's own, ``localhost`` and
        addresses in numbers.

    Raises
    ------
    OSError
        If it cannot listen there.
    """

    def __init__(self, host: str, port: int, names: Collection[str] = ()) -> None:
        _check_address(host, port)
        own = (socket.gethostname(), socket.getfqdn(), host, *names)
        with _guarded(lambda origin, to: is_own_page(origin, to, own)) as guards:
            super().__init__(host, port, verbose=False)
        if not guards:  # another release of viser: better no page than an open one
            self.stop()
            raise OSError("this version of viser cannot be kept from serving foreign origins")

    @property
    def address(self) -> str:
        """For browsers."""
        host = self.get_host()
        name = socket.gethostname() if host in ANY else f"[{host}]" if ":" in host else host
        return f"http://{name}:{self.get_port()}"

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse what any page could ask for: to be reached through a server in the internet."""
        return None


@contextmanager
def _guarded(is_own: Callable[[str, str], bool]) -> Iterator[list[str]]:
    """Let the servers that viser starts in a context check who connects; yield a list of them.

    viser starts the server of websockets without a check of origins, and does not let its users
    add one.
    """
    serve, guarded = websockets.asyncio.server.serve, []

    def guarded_serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            headers = request.headers
            upgrade = "Upgrade" in headers
            if upgrade and not is_own(headers.get("Origin", ""), headers.get("Host", "")):
                return connection.respond(http.HTTPStatus.FORBIDDEN, "foreign origin\n")
            return process_request(connection, request)

        guarded.append("served")
        return serve(*arguments, process_request=process, **options)

    websockets.asyncio.server.serve = guarded_serve  # type: ignore[assignment, misc]
    try:
        yield guarded
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def _check_address(host: str, port: int) -> None:
    """Raise `OSError` if nobody can listen there, where viser would try on and on."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
    except OSError as error:
        raise OSError(f"cannot listen at {host}, port {port}: {error.strerror or error}") from error


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
