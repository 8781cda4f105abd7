"""The explorer: a local page on which sliders change a scene, and its curve follows."""
