"""What is said of a file that is refused."""

import pytest

from tral_fsm import FormatError
from tral_fsm.formats import read


def message(content: str | bytes, suffix: str = "") -> str:
    """The problems of a file, a line each."""
    with pytest.raises(FormatError) as caught:
        read(content, "my.file", suffix)
    assert str(caught.value).startswith("my.file: ")
    return "\n".join(str(problem) for problem in caught.value.problems)
