"""Zenoh, typed: sessions, topics, services, the graph, parameters. Only this folder imports zenoh."""
