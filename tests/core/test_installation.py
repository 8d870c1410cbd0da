"""The command that adds an extra fits the way in which the package was installed."""

import json
from importlib import metadata
from pathlib import Path

import pytest

from tral_env.errors import MissingExtraError
from tral_env.installation import CPU_TORCH, Installation, installed


class Distribution:
    """What pip left of an installation: the text of `direct_url.json`, or none."""

    def __init__(self, origin: object) -> None:
        self.origin = origin

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return None if self.origin is None else json.dumps(self.origin)


@pytest.fixture
def pip_wrote(monkeypatch: pytest.MonkeyPatch):
    def write(origin: object) -> None:
        monkeypatch.setattr(metadata, "distribution", lambda name: Distribution(origin))

    return write


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    folder = tmp_path / "my clone"
    folder.mkdir()
    (folder / "pyproject.toml").write_text("")
    return folder


def test_an_editable_installation_stays_editable_when_an_extra_is_added(pip_wrote, clone: Path) -> None:
    pip_wrote({"url": clone.as_uri(), "dir_info": {"editable": True}})
    told = str(MissingExtraError("viser", "live", "the page"))
    assert told.endswith(f"which is not installed: in {clone}, run: pip install -e '.[live]'")


def test_a_copied_installation_is_installed_again_from_its_clone(pip_wrote, clone: Path) -> None:
    pip_wrote({"url": clone.as_uri(), "dir_info": {}})
    told = str(MissingExtraError("viser", "live", "the page"))
    assert told.endswith(f"which is not installed: in {clone}, run: pip install '.[live]'")


def test_a_clone_that_is_there_no_more_is_not_named(pip_wrote, tmp_path: Path) -> None:
    pip_wrote({"url": (tmp_path / "gone").as_uri(), "dir_info": {}})
    assert installed() == Installation(clone=None, editable=False)


@pytest.mark.parametrize("origin", [None, {"url": "https://example.org/tral_env-0.1.0.whl", "archive_info": {}}])
def test_a_package_from_elsewhere_needs_any_clone(pip_wrote, origin: object) -> None:
    pip_wrote(origin)
    assert installed().command("live") == "in a clone of the repository, run: pip install '.[live]'"


def test_code_that_pip_never_saw_is_installed_where_it_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    assert installed() == Installation(clone=Path(__file__).parents[2], editable=True)


def test_the_extra_with_torch_names_the_cpu_build(clone: Path) -> None:
    told = Installation(clone=clone, editable=True).command("rl")
    assert told == f"in {clone}, run: pip install -e '.[rl]' ({CPU_TORCH})"


def test_without_an_extra_the_package_itself_is_installed(clone: Path) -> None:
    again = Installation(clone=clone, editable=True).command(options="--force-reinstall --no-deps")
    assert again == f"in {clone}, run: pip install --force-reinstall --no-deps -e ."
