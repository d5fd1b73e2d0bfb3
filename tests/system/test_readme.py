"""The examples in the README run as they stand."""

import re

import pytest

from tests.readme import examples, is_fit, run


def test_the_fit_runs(example_of_a_fit):
    assert re.search(r"C13 .*W1/std \d\.\d{3}", example_of_a_fit.output)
    assert (example_of_a_fit.folder / "out" / "example" / "report.html").is_file()


@pytest.mark.parametrize(
    "code",
    [code for code in examples() if not is_fit(code)],
    ids=lambda code: code.split("\n")[0],
)
def test_the_other_examples_run(code, tmp_path):
    run(code, tmp_path)
