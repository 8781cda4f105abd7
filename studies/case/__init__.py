"""Cases: from a TOML file to modes, rigid model and reduced model."""
