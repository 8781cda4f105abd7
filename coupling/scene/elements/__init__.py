"""Elements of a scene: tables whose entries are units, contacts or friction. Each is one class (element.SceneElement)."""
