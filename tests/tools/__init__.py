"""What several tests share: scenes, meshes and cases, the engine step by step, commands as processes."""
