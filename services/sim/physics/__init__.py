"""The engine, and what moves in it: planar bases, jointed robots, wheels. Only engine.py imports pybullet."""
