"""What tests of the twin ask for."""

import pytest

from tral_env.twin.devices import why_no_files


@pytest.fixture(scope="session")
def device_files() -> None:
    """What a test of device files asks for: it is skipped where this computer cannot show any."""
    if reason := why_no_files():
        pytest.skip(reason)
