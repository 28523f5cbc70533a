"""The engine, and what moves in it: planar bases, jointed robots, wheels. Only bullet.py and
mujoco.py import one.
"""
