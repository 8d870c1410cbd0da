"""Where a page is served: the address in a browser, its token, and whether the program can listen there."""

from __future__ import annotations

import secrets
import socket
from contextlib import ExitStack
from urllib.parse import quote

from tral_env.errors import ConfigError

LOCAL = ("127.0.0.1", "localhost", "::1")
"""Only this computer can reach a server that listens on one of these."""

_ALL = ("0.0.0.0", "::", "")
"""A server that listens on one of these listens on every address of the computer."""
_TRIES = 100
"""So many ports are tried, one after the other."""
_MAX_PORT = 65535


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(16)


def address(host: str, port: int, token: str | None) -> str:
    """What is typed into a browser."""
    name = socket.gethostname() if host in _ALL else host
    page = f"[{name}]:{port}" if ":" in name else f"{name}:{port}"
    if token is None:
        return f"http://{page}"
    return f"http://{page}/?websocket={quote(f'ws://{page}/?token={token}', safe='')}"


def free_port(host: str, port: int) -> int:
    """The first port from `port` on that a page can listen on; 0 stays 0: any.

    Raises:
        ConfigError: this computer has no such address, or all of these ports are taken.
    """
    last = min(port + _TRIES - 1, _MAX_PORT) if port else 0
    told = "no port was tried"
    for each in range(port, last + 1):
        try:
            _listen(host, each)
        except socket.gaierror as error:
            raise ConfigError(f"--host {host}: {error.strerror}: expected an address of this computer") from error
        except OSError as error:
            told = error.strerror or str(error)
        else:
            return each
    ports = f"--port {port}" if last == port else f"--port {port} to {last}"
    raise ConfigError(
        f"the page cannot listen on --host {host}, {ports}: {told}: "
        "expected an address of this computer and a free port"
    )


def _listen(host: str, port: int) -> None:
    """Listen for a moment on all addresses of a host."""
    found = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    with ExitStack() as stack:
        for family, kind, protocol, _, place in dict.fromkeys(found):
            door = stack.enter_context(socket.socket(family, kind, protocol))
            door.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                door.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            door.bind(place)
            door.listen(1)
