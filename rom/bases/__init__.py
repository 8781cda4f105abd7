"""The reduction bases: Craig-Bampton, and the free-interface ones of Rubin and MacNeal."""
