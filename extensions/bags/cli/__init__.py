"""The verbs record, replay and bag."""
