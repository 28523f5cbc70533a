"""The secure set-up: certificates of members, their roles, and the proof of their commands."""
