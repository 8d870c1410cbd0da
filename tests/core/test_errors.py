"""How errors are worded."""

from tral_env.errors import problem_list, problem_report


def test_a_report_counts_its_problems_and_gives_each_a_line() -> None:
    assert problem_report("my.json", ["no root", "no state"]) == "my.json: 2 problems\n  no root\n  no state"


def test_one_problem_is_told_in_the_singular() -> None:
    assert problem_report("my.json", ["no root"]) == "my.json: 1 problem\n  no root"


def test_a_list_begins_with_its_head() -> None:
    assert problem_list("cannot be used:", [1, 2]) == "cannot be used:\n  1\n  2"
