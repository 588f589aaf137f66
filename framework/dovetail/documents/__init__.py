"""YAML and dicts with positions: read within limits, merged with what they extend, validated; every fault at once."""
