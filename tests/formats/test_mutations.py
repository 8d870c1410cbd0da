"""Whatever stands in a file: it gives a definition or a FormatError, and soon."""

import time

import pytest
from mutations import WAYS, mutated

from tral_fsm import FormatError, MachineDefinition
from tral_fsm.formats import read


def outcomes(name: str, count: int, seed: int) -> tuple[int, int, float]:
    """How many were machines, how many were not, and the longest time, s."""
    good = bad = 0
    longest = 0.0
    for content in mutated(name, count, seed):
        begin = time.process_time()
        try:
            assert isinstance(read(content, "my.file"), MachineDefinition)
            good += 1
        except FormatError as error:
            bad += bool(error.problems) and str(error).startswith("my.file: ")
        longest = max(longest, time.process_time() - begin)
    assert good + bad == count
    return good, bad, longest


@pytest.mark.parametrize("name", WAYS)
def test_a_mutated_file_gives_a_definition_or_a_format_error(name: str) -> None:
    good, bad, longest = outcomes(name, 375, 1)
    assert good > 2
    assert bad > 100
    assert longest < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", WAYS)
def test_a_thousand_mutated_files(name: str) -> None:
    good, bad, longest = outcomes(name, 1000, 2)
    assert good > 10
    assert bad > 300
    assert longest < 2.0
