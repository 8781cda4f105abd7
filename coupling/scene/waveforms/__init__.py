"""The waveforms of the package: multi-sine and measured history."""
