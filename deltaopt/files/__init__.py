"""Reading YAML, validating records, writing files that are whole or absent."""
