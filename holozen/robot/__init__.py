"""Robot and world files (xacro, URDF, SDF) -> a checked RobotModel or WorldSpec."""
