"""Pictures of outputs."""
