"""Tests of coupling/contacts/."""
