"""From a scene to a verified motion."""
