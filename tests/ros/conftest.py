"""Nodes of the tests speak over loopback alone, without multicast, each worker of pytest in a domain of its own."""

import os

import pytest

pytest.importorskip("cyclonedds")

LOOPBACK = """
<CycloneDDS><Domain>
  <General>
    <AllowMulticast>false</AllowMulticast>
    <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
  </General>
  <Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>
"""


@pytest.fixture(autouse=True, scope="session")
def loopback() -> None:
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
    os.environ["ROS_DOMAIN_ID"] = str(60 + os.getpid() % 50 + worker)
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
