"""Tests of coupling/scene/waveforms/."""
