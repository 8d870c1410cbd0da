"""Who may talk to the page: a browser that shows the token or, where none is asked for, a page of this server."""

from __future__ import annotations

import hmac
import logging
from collections.abc import Mapping
from typing import Any
from urllib.parse import parse_qs, urlsplit

import viser

from tral_fsm.live.address import LOCAL


class RefusedError(Exception):
    """The browser may not talk to the page."""


def why_refused(path: str, headers: Mapping[str, str], token: str | None) -> str:
    """Why a connection is refused; empty: it is not.

    A page of another site must not command a car through the browser of somebody who looks at it: its `Origin` is not
    this server.

    Args:
        path: of the request, with its query.
        headers: of the request.
        token: what the query must show; None: nothing.
    """
    origin, host = headers.get("Origin"), headers.get("Host", "")
    if origin is not None and urlsplit(origin).netloc != host:
        return f"it comes from a page of {origin}"
    if token is None:
        return "" if urlsplit(f"//{host}").hostname in LOCAL else f"it calls this computer {host}"
    shown = parse_qs(urlsplit(path).query).get("token", [""])[0]
    return "" if hmac.compare_digest(shown.encode(), token.encode()) else "it does not show the token"


def guard(server: viser.ViserServer, token: str | None) -> None:
    """Let nobody in whom `why_refused` refuses, and let no browser publish the page elsewhere."""
    # Parts of viser that it does not document: it has no door for this. tests/live/test_page_guard.py holds them.
    connections: Any = server._websock_server
    for message in (viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect):
        connections.unregister_handler(message)

    async def look(client: Any) -> None:
        connection = connections._live_connections[client.client_id]
        refused = why_refused(connection.request.path, connection.request.headers, token)
        if refused:
            connections._live_connections.pop(client.client_id)
            connections._client_state_from_id.pop(client.client_id)
            await connection.close(1008, refused)
            raise RefusedError(refused)

    connections.on_client_connect(look)
    connections.disconnect_all_clients()  # whoever came before this door was there
    logging.getLogger("websockets.server").addFilter(_is_no_refusal)


def _is_no_refusal(record: logging.LogRecord) -> bool:
    """The log need not tell of a refusal as if the server had failed."""
    return not (record.exc_info and isinstance(record.exc_info[1], RefusedError))
