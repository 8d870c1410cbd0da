"""The page about the twin lists the faults that there are."""

from pages import read, table

from tral_env.twin.faults import INJECTED_FAULTS


def test_the_table_of_faults_is_that_of_the_program() -> None:
    rows = table(read("docs/twin.md"), "| fault |")
    assert {row[0].strip("`"): row[1] for row in rows} == {name: fault.told for name, fault in INJECTED_FAULTS.items()}
