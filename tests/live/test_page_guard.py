"""Who may talk to the page."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest
from browser import Browser
from websockets.exceptions import ConnectionClosed

from tral_env.errors import ConfigError
from tral_fsm.live.address import address, free_port, new_token
from tral_fsm.live.drive import LiveDrive
from tral_fsm.live.frame import Course
from tral_fsm.live.guard import why_refused
from tral_fsm.live.page import Page

LOCAL = {"Host": "127.0.0.1:8080", "Origin": "http://127.0.0.1:8080"}


@pytest.mark.parametrize(
    ("path", "headers", "token", "refused"),
    [
        ("/", LOCAL, None, ""),
        ("/", {"Host": "localhost:8080"}, None, ""),
        ("/", {"Host": "127.0.0.1:8080", "Origin": "https://elsewhere.org"}, None, "elsewhere.org"),
        ("/", {"Host": "elsewhere.org", "Origin": "http://elsewhere.org"}, None, "elsewhere.org"),
        ("/?token=right", {"Host": "car:8080", "Origin": "http://car:8080"}, "right", ""),
        ("/?token=wrong", {"Host": "car:8080", "Origin": "http://car:8080"}, "right", "token"),
        ("/", {"Host": "car:8080"}, "right", "token"),
        ("/?token=right", {"Host": "car:8080", "Origin": "http://elsewhere.org"}, "right", "elsewhere.org"),
    ],
)
def test_a_page_of_another_site_and_a_wrong_token_are_refused(
    path: str, headers: dict[str, str], token: str | None, refused: str
) -> None:
    told = why_refused(path, headers, token)
    assert (refused in told) if refused else told == ""


def test_an_address_of_ipv6_stands_in_brackets() -> None:
    assert address("::1", 8080, None) == "http://[::1]:8080"


def test_tokens_differ() -> None:
    assert len({new_token() for _ in range(20)}) == 20
    assert len(new_token()) >= 20


def test_the_address_brings_the_token_along() -> None:
    assert address("127.0.0.1", 8080, None) == "http://127.0.0.1:8080"
    assert address("10.0.0.5", 8080, "abc").endswith("?websocket=ws%3A%2F%2F10.0.0.5%3A8080%2F%3Ftoken%3Dabc")


def test_a_port_that_is_taken_leaves_the_next_one() -> None:
    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        door.listen(1)
        taken = door.getsockname()[1]
        assert free_port("127.0.0.1", taken) > taken
    assert free_port("127.0.0.1", 0) == 0


@pytest.mark.parametrize("host", ["192.0.2.1", "nowhere.invalid"])
def test_an_address_of_another_computer_is_refused_at_once(host: str) -> None:
    with pytest.raises(ConfigError, match=f"--host {host}.*an address of this computer"):
        free_port(host, 8080)


@pytest.fixture
def page() -> Iterator[Page]:
    live = LiveDrive(Course(scenario="straight", seed=1), ["wall"])
    live.shows_camera = False
    page = Page(live, port=0, token="secret")
    yield page
    page.close()
    live.close()


def test_with_the_token_a_browser_sees_the_page(page: Page) -> None:
    with Browser(page.url) as browser:
        browser.until(lambda: "Pause" in browser.labels)


def test_without_it_a_browser_gets_nothing_and_is_heard_by_nobody(page: Page) -> None:
    plain = f"http://127.0.0.1:{page.server.get_port()}"
    try:
        with Browser(plain) as browser:
            browser.take(1.0)
            assert browser.received == 0
    except ConnectionClosed:
        pass
    assert page.server.get_clients() == {}


def test_a_page_of_another_site_is_refused(page: Page) -> None:
    with pytest.raises(ConnectionClosed), Browser(page.url, Origin="https://elsewhere.org") as browser:
        browser.until(lambda: False)
    assert page.server.get_clients() == {}


def test_no_browser_can_publish_the_page_elsewhere(page: Page) -> None:
    from viser import _messages as messages

    heard = page.server._websock_server._incoming_handlers
    assert messages.ShareUrlRequest not in heard
