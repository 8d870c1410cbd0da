"""Every reference machine drives bit for bit as it did when the digests were written; see drives.py.

Where a change is meant to change drives: `python tests/golden/drives.py --write`, in a commit that says why.
"""

import pytest
from drives import GROUPS, RAMP, RENDERED, SEEDS, Group, alone, arithmetic, load, together

KEPT = load()
pytestmark = pytest.mark.skipif(
    KEPT["arithmetic"] != arithmetic(),
    reason="MuJoCo, NumPy or the processor rounds otherwise than where it was written",  # tests/conftest.py tells it
)


@pytest.mark.parametrize("group", [*GROUPS, *RAMP], ids=lambda group: "-".join(group[:3]))
def test_a_batch_drives_as_it_did(group: Group) -> None:
    expected = [KEPT["drives"][group.name(seed)] for seed in SEEDS]
    assert together(group) == expected


@pytest.mark.parametrize("group", [GROUPS[0], GROUPS[6], GROUPS[10], GROUPS[-1]], ids=lambda group: "-".join(group[:3]))
def test_a_car_alone_drives_as_it_did(group: Group) -> None:
    assert alone(group, 1) == KEPT["drives"][group.name(1)]


@pytest.mark.usefixtures("opengl")
def test_a_drive_with_the_rendered_camera_is_as_it_was() -> None:
    assert alone(RENDERED, 3) == KEPT["drives"][RENDERED.name(3)]
