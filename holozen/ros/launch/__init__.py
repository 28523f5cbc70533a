"""Launch files of the plain kind: what `from launch import ...` finds in `holozen launch`."""
