"""Tests of coupling/scene/contact_laws/."""
