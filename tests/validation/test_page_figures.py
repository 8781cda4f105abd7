"""Every figure of docs/validation.md: against its reference, and against what the page prints."""

from pathlib import Path

import pytest

from tests.validation import contact, modes
from tests.validation.page import Page

CASES = [*contact.CASES, *modes.CASES]


@pytest.fixture(scope="module")
def page():
    return Page()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_figures(case, page):
    for figure in case.compute():
        assert figure.holds, figure
        page.check(case, figure)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_named_tests_are_there(case):
    file, function = case.test.strip("`").split("::")
    assert f"def {function}(" in (Path(__file__).parent.parent.parent / file).read_text()
