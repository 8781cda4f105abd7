"""Elements of a scene: tables whose entries are units. Each is a class in a file of its own (element.SceneElement)."""
