"""Ground: files of records, validated TOML, provenance."""
