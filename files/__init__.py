"""Ground of all parts: `errors` (the base of all), `store` (HDF5 records, whole files), `toml_input`, `provenance`,
`extensions` (parts that are found by name)."""
