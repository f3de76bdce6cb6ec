"""Pictures of walking feet, drawn: what the simulated camera sees. Ships with the product (demo, tests, evaluation)."""
