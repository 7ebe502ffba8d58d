"""Files: reading YAML, validating records, writing atomically."""
