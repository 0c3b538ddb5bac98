"""Scene files: TOML as tables, and what the tables say."""
