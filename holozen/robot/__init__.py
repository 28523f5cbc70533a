"""xacro and URDF files -> a checked RobotModel."""
