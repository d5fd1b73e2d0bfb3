"""The faults that are planted have a place in the code and a test, as it is today."""

import ast
import xml.etree.ElementTree as ET

import pytest
from tools.plant_faults import FAILS, PASSES, ROOT, Fault, ended, read_faults


FAULTS = read_faults()


def _functions(file: str) -> set[str]:
    tree = ast.parse((ROOT / file).read_text("utf-8"))
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.fault)
def test_a_fault_has_its_place_and_its_test(fault):
    text = (ROOT / fault.file).read_text("utf-8")
    planted = fault.planted(text)
    assert planted != text
    # A test that cannot begin finds nothing.
    ast.parse(planted)
    file, name = fault.test.split("::")
    assert name.split("[")[0] in _functions(file)


def test_each_fault_has_words_of_its_own():
    words = [fault.fault for fault in FAULTS]
    assert len(set(words)) == len(words)


def test_what_is_not_there_once_is_not_planted():
    fault = Fault("part", "words", "file.py", "one", "two", "test.py::test")
    assert fault.planted("one = 1") == "two = 1"
    for text in ("", "one = one"):
        with pytest.raises(ValueError, match=r"file\.py has what is replaced [02] t"):
            fault.planted(text)


@pytest.mark.parametrize(
    ("inside", "expected"),
    [
        ("", PASSES),
        ('<failure message="assert 1 == 2"/>', FAILS),
        ('<failure message="AssertionError: Not equal to tolerance"/>', FAILS),
        ('<failure message="Failed: DID NOT RAISE"/>', FAILS),
        ('<failure message="NameError: x"/>', "breaks: NameError: x"),
        ('<error message="assert 1 == 2"/>', "breaks: assert 1 == 2"),
        ("<skipped/>", "has run nothing"),
    ],
)
def test_only_assertions_find_faults(inside, expected):
    """What a fixture asserts is no finding of the test's own."""
    case = ET.fromstring(f"<testcase>{inside}</testcase>")
    assert ended([case]) == expected
    assert ended([]) == "has run nothing"
