"""Compute every figure of docs/validation.md and write its tables, in about a minute.

.venv/bin/python -m tests.validation
"""

from tests.validation import contact, modes
from tests.validation.page import Page

page = Page()
page.write("contact", contact.CASES)
page.write("modes", modes.CASES)
