"""cmd_vel, joint_command, forces -> the motion of a robot: fresh, within limits, from the source
that drives.
"""
