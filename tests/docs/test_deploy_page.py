"""The figures of the deploy page are those of the results."""

import sys
from pathlib import Path

from pages import ROOT, read

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
import deploy_table

RESULTS = sorted((ROOT / "benchmarks" / "results").glob("deploy_*.json"))


def test_the_tables_of_drives_are_those_of_the_results() -> None:
    found, page = deploy_table.load(RESULTS), read("docs/deploy.md")
    assert deploy_table.success_table(found) in page
    assert deploy_table.loop_table(found) in page


def test_each_drive_on_the_twin_has_a_simulated_one_beside_it() -> None:
    found = deploy_table.load(RESULTS)
    for drives in found.values():
        for name in deploy_table.SIMULATED:
            beside = deploy_table.same(found[name], drives)
            assert [drive["seed"] for drive in beside] == [drive["seed"] for drive in drives]
