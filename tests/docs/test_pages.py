"""The pages hang together and their tables say what the code says."""

from __future__ import annotations

import ast
import importlib
import re
import tomllib
from itertools import pairwise
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import yaml
from pages import PAGES, ROOT, read, table

from tral_env import randomization
from tral_env.course.generate import FAMILIES
from tral_env.interface import CORE_LAYOUT, OPTIONAL_GROUPS
from tral_env.randomization import LEVELS, PARAMETERS
from tral_env.world import RESET_OPTIONS

UNITS = ("deg", "s", "V", "ohm")


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_are_there(page: str) -> None:
    targets = re.findall(r"\]\(([^)#]+?)(?:#[^)]*)?\)", read(page))
    local = [target for target in targets if "://" not in target]
    assert [target for target in local if not (ROOT / page).parent.joinpath(target).exists()] == []


@pytest.mark.parametrize("page", PAGES)
def test_quoted_files_are_there(page: str) -> None:
    quoted = re.findall(r"`((?:tral_env|tral_fsm|tests|benchmarks|assets)/[\w/.]+\.\w+)`", read(page))
    assert [path for path in quoted if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", [*PAGES, "CHANGELOG.md"])
def test_no_line_of_prose_is_longer_than_one_of_the_code(page: str) -> None:
    prose = re.sub(r"^```.*?^```$", "", read(page), flags=re.DOTALL | re.MULTILINE)
    assert [line for line in prose.splitlines() if len(line) > 140 and not line.startswith("|")] == []


def test_the_index_knows_every_page() -> None:
    listed = re.findall(r"\]\(([^)]+\.md)\)", read("docs/README.md"))
    assert sorted(listed) == sorted(path.name for path in (ROOT / "docs").glob("*.md") if path.name != "README.md")


def test_pictures_of_the_readme_are_small() -> None:
    pictures = [ROOT / name for name in re.findall(r"!\[.*?\]\((.*?)\)", read("README.md"))]
    assert len(pictures) == 2
    assert all(picture.stat().st_size < 300_000 for picture in pictures)


def test_randomization_page_shows_the_levels() -> None:
    shown = table(read("docs/randomization.md"), "| parameter |")
    assert ["| " + " | ".join(row) + " |" for row in shown] == randomization_rows()


def randomization_rows() -> list[str]:
    """Rows of the page's table, from the code and what it says below each field."""
    module = ast.parse(Path(randomization.__file__).read_text(encoding="utf-8"))
    body = next(node.body for node in module.body if isinstance(node, ast.ClassDef) and node.name == "Randomization")
    rows = []
    for field, below in pairwise(body):
        if not isinstance(field, ast.AnnAssign):
            continue
        name = ast.unparse(field.target)
        if name not in PARAMETERS:
            continue
        meaning, _, source = ast.literal_eval(ast.unparse(below)).partition(" Source: ")
        what, _, unit = meaning.removesuffix(".").rpartition(", ")
        what, unit = (what, unit) if unit in UNITS else (meaning.removesuffix("."), "-")
        levels = [span(*getattr(LEVELS[level], name)) for level in ("none", "default", "hard")]
        rows.append("| " + " | ".join([f"`{name}`", *levels, unit, what, source.removesuffix(".")]) + " |")
    return rows


def span(low: float, high: float) -> str:
    return f"{low:g}" if low == high else f"{low:g} .. {high:g}"


def test_environment_page_shows_the_fields() -> None:
    assert CORE_LAYOUT.table() in read("docs/environment.md")


def test_environment_page_names_the_optional_groups() -> None:
    rows = table(read("docs/environment.md"), "| group |")
    assert {row[0].strip("`"): int(row[1]) for row in rows} == {
        name: len(fields) for name, fields in OPTIONAL_GROUPS.items()
    }


def test_environment_page_names_the_reset_options() -> None:
    rows = table(read("docs/environment.md"), "| option |")
    assert [row[0].strip("`") for row in rows] == [*RESET_OPTIONS, "reset_mask"]


def test_environment_page_names_every_key_of_info() -> None:
    shown = {row[0].strip("`") for row in table(read("docs/environment.md"), "| key |")}
    env = gym.make("tral_env:TralCorridor-v0", scenario="straight", randomization="none")
    _, first = env.reset(seed=0)
    keys = set(first)
    ended = False
    while not ended:  # into the wall
        _, _, terminated, truncated, info = env.step(np.array([1.0, 1.0], np.float32))
        keys |= set(info)
        ended = terminated or truncated
    env.close()
    assert shown == keys


def test_courses_page_describes_every_family() -> None:
    assert [row[0].strip("`") for row in table(read("docs/courses.md"), "| family |")] == [*FAMILIES]


def test_install_page_has_a_line_for_each_extra() -> None:
    extras = tomllib.loads(read("pyproject.toml"))["project"]["optional-dependencies"]
    shown = {row[0].strip("`"): row[1] for row in table(read("docs/install.md"), "| extra |")}
    assert shown == {extra: f"`pip install '.[{extra}]'`" for extra in extras}


def test_the_citation_has_the_version_and_licence_of_the_package() -> None:
    project = tomllib.loads(read("pyproject.toml"))["project"]
    citation = yaml.safe_load(read("CITATION.cff"))
    assert (citation["title"], citation["version"], citation["license"]) == (
        project["name"],
        project["version"],
        project["license"],
    )


def test_policy_page_says_where_to_import_what() -> None:
    rows = table(read("docs/policy.md"), "| name | from |")
    assert len(rows) > 5
    for names, module in rows:
        if module == "`tral_env.sb3`":
            pytest.importorskip("stable_baselines3", exc_type=ImportError)
        for name in re.findall(r"`(\w+)`", names):
            assert hasattr(importlib.import_module(module.strip("`")), name), name
